// Links to an attempt, and files of it: picture, film, episode.

import { ask, Refused } from "../../common/api";
import { copied, element } from "../../common/dom";
import { FILM } from "../film";
import type { Frame, Model, ObjectLoaded, Ready, Told, Verdict } from "../protocol";
import { save } from "../save";
import { linkOf, type Shared } from "../share";
import { SHARE } from "../strings";

export interface ShareEvents {
  // Where the viewer stands and looks, if there is anything to be seen.
  view(): number[] | null;
  picture(): Promise<Blob | null>;
  canvas(): HTMLCanvasElement;
  episode(): void;
  // What was said of the file that stands there.
  told(): Told | null;
  // The file that stands there, if it is one.
  file(): File | null;
}

export class SharePanel {
  readonly #events: ShareEvents;
  readonly #link = element("copy-link", HTMLButtonElement);
  readonly #film = element("save-webm", HTMLButtonElement);
  readonly #episode = element("save-json", HTMLButtonElement);
  readonly #store = element("store", HTMLButtonElement);
  readonly #hint = element("share-hint", HTMLElement);
  // Id of the object's file on the server.
  #mesh: string | null = null;
  #scene = "";
  #object: ObjectLoaded | null = null;
  #model: Model | null = null;
  #frame: Frame | null = null;
  #verdict: Verdict | null = null;
  #sending: AbortController | null = null;
  #recorder: MediaRecorder | null = null;

  constructor(events: ShareEvents) {
    this.#events = events;
    this.#link.addEventListener("click", () => void this.copy());
    element("save-png", HTMLButtonElement).addEventListener("click", () => void this.#savePicture());
    this.#film.addEventListener("click", () => this.#record());
    this.#film.hidden = !FILM;
    this.#episode.addEventListener("click", () => events.episode());
    this.#store.addEventListener("click", () => void this.#keep());
  }

  ready({ scene }: Ready): void {
    this.#scene = scene;
  }

  hasObject(object: ObjectLoaded): void {
    [this.#object, this.#mesh] = [object, null];
    // The file that was asked about, or is being sent, is another one's.
    this.#store.hidden = true;
    this.#sending?.abort();
    this.#judge(null);
  }

  hasModel(model: Model): void {
    this.#model = model;
    // What is played goes on, whoever comes to act.
    if (!this.#verdict?.played) this.#judge(null);
  }

  show(frame: Frame): void {
    this.#frame = frame;
    // Another attempt has begun; one that fails at once has its verdict then.
    if (this.#verdict && frame.ticks === 0 && frame.phase !== "verdict") this.#judge(null);
  }

  showVerdict(verdict: Verdict): void {
    this.#judge(verdict);
  }

  // What the attempt came to, if it is over.
  #judge(verdict: Verdict | null): void {
    this.#verdict = verdict;
    // What is played is a file or a search of its own, and what the planner does depends on more than a link can say.
    const isOwn = verdict !== null && !verdict.played && this.#model?.id != null;
    const why = verdict?.pulled ? SHARE.pulled : verdict && !isOwn ? SHARE.noPolicy : null;
    this.#link.disabled = !isOwn || verdict.pulled;
    this.#episode.disabled = !verdict || verdict.pulled;
    // What is said again is not read out again.
    const hint = why ?? SHARE.hint;
    if (this.#hint.textContent !== hint) this.#hint.textContent = hint;
  }

  async copy(): Promise<void> {
    const [object, model, verdict, frame] = [this.#object, this.#model, this.#verdict, this.#frame];
    if (this.#link.disabled || !object || !model?.id || !verdict || !frame) return;
    const told = this.#events.told();
    const shared: Shared = {
      object: object.name ?? object.label,
      objectHash: object.hash,
      // How it stands may have been guessed: another version may guess otherwise.
      told: told && { ...told, unit: object.report.unit, stands: object.report.stands },
      mesh: this.#mesh,
      pose: verdict.pose,
      placed: verdict.placed,
      seed: verdict.seed,
      model: model.id,
      modelHash: model.hash,
      scene: this.#scene,
      view: this.#events.view(),
      tick: frame.tick < frame.ticks ? frame.tick : null,
      end: verdict.hash,
    };
    const link = linkOf(shared);
    const needsFile = object.name === null && this.#mesh === null;
    this.#store.hidden = !needsFile;
    const isCopied = await copied(this.#hint, link);
    this.#hint.textContent = isCopied ? (needsFile ? SHARE.copiedWithoutFile : SHARE.copied) : link;
    if (!isCopied) getSelection()?.selectAllChildren(this.#hint);
  }

  // Stores the file on the server, on purpose, so that the link suffices.
  async #keep(): Promise<void> {
    // Pressed again while it is sent.
    if (this.#sending) return this.#sending.abort();
    const file = this.#events.file();
    if (!file) return;
    this.#sending = new AbortController();
    const words = this.#store.textContent;
    this.#store.textContent = SHARE.stopSending;
    this.#hint.textContent = SHARE.sending(file.name);
    try {
      const { limits } = await ask<{ limits: { mesh_bytes: number } }>("../v1", "GET", undefined, { signal: this.#sending.signal });
      if (file.size > limits.mesh_bytes) {
        this.#hint.textContent = SHARE.notKept(SHARE.tooLarge(file.name, limits.mesh_bytes / 1e6));
        return;
      }
      const path = `meshes?name=${encodeURIComponent(file.name)}`;
      const { id } = await ask<{ id: string }>(path, "POST", file, { signal: this.#sending.signal });
      this.#mesh = id;
      this.#store.hidden = true;
      // Of an attempt that is over by now there may be a link.
      this.#hint.textContent = SHARE.kept;
      await this.copy();
    } catch (error) {
      const isOwn = this.#sending.signal.aborted;
      const why = error instanceof Refused && error.problem.code !== "no_server" ? error.problem.detail.replace(/\.$/, "") : SHARE.noServer;
      this.#hint.textContent = isOwn ? SHARE.notSent : SHARE.notKept(why);
    } finally {
      this.#sending = null;
      this.#store.textContent = words;
    }
  }

  async #savePicture(): Promise<void> {
    const picture = await this.#events.picture();
    if (picture) save("ngf-grasp.png", picture);
  }

  // Records what is shown until it is pressed again.
  #record(): void {
    if (this.#recorder) {
      this.#recorder.stop();
      return;
    }
    const parts: Blob[] = [];
    const type = `video/${FILM}`;
    const recorder = new MediaRecorder(this.#events.canvas().captureStream(30), { mimeType: type });
    recorder.ondataavailable = ({ data }) => parts.push(data);
    recorder.onstop = () => {
      this.#recorder = null;
      this.#film.textContent = SHARE.film;
      save(`ngf-grasp.${FILM}`, new Blob(parts, { type }));
    };
    recorder.start();
    this.#recorder = recorder;
    this.#film.textContent = SHARE.stop;
  }
}
