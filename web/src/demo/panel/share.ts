// Links to an attempt, and files of it: picture, film, episode.

import { ask, Refused } from "../../common/api";
import { element } from "../../common/dom";
import type { Frame, Model, ObjectLoaded, Ready, Told, Verdict } from "../protocol";
import { save } from "../save";
import { linkOf, type Shared } from "../share";
import { SHARE } from "../strings";

export interface ShareEvents {
  // Where the viewer stands and looks.
  view(): number[];
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
    this.#film.hidden = !("MediaRecorder" in window);
    this.#episode.addEventListener("click", () => events.episode());
    this.#store.addEventListener("click", () => void this.#keep());
  }

  ready({ scene }: Ready): void {
    this.#scene = scene;
  }

  hasObject(object: ObjectLoaded): void {
    [this.#object, this.#verdict, this.#mesh] = [object, null, null];
    this.#enable();
  }

  hasModel(model: Model): void {
    [this.#model, this.#verdict] = [model, null];
    this.#enable();
  }

  show(frame: Frame): void {
    this.#frame = frame;
    // Another attempt has begun.
    if (this.#verdict && frame.ticks === 0) [this.#verdict, this.#hint.textContent] = [null, SHARE.hint];
    this.#enable();
  }

  showVerdict(verdict: Verdict): void {
    this.#verdict = verdict;
    this.#enable();
  }

  #enable(): void {
    // A demonstration is a file of its own, and what the planner does depends on more than a link can say.
    // Nor can it say how somebody pulled.
    const isOwn = this.#verdict !== null && this.#verdict.played === null && !this.#verdict.pulled;
    this.#link.disabled = !isOwn || this.#model?.id == null;
    this.#episode.disabled = !this.#verdict || this.#verdict.pulled;
  }

  async copy(): Promise<void> {
    const [object, model, verdict, frame] = [this.#object, this.#model, this.#verdict, this.#frame];
    if (this.#link.disabled || !object || !model?.id || !verdict || !frame) return;
    const shared: Shared = {
      object: object.name ?? object.label,
      objectHash: object.hash,
      told: this.#events.told(),
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
    try {
      await navigator.clipboard.writeText(link);
      this.#hint.textContent = needsFile ? SHARE.copiedWithoutFile : SHARE.copied;
    } catch {
      this.#hint.textContent = link;
    }
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
      const path = `meshes?name=${encodeURIComponent(file.name)}`;
      const { id } = await ask<{ id: string }>(path, "POST", file, this.#sending.signal);
      this.#mesh = id;
      await this.copy();
    } catch (error) {
      const isOwn = this.#sending.signal.aborted;
      const why = error instanceof Refused && error.problem.status > 0 ? error.problem.detail : SHARE.noServer;
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
    const recorder = new MediaRecorder(this.#events.canvas().captureStream(30), { mimeType: "video/webm" });
    recorder.ondataavailable = ({ data }) => parts.push(data);
    recorder.onstop = () => {
      this.#recorder = null;
      this.#film.textContent = SHARE.film;
      save("ngf-grasp.webm", new Blob(parts, { type: "video/webm" }));
    };
    recorder.start();
    this.#recorder = recorder;
    this.#film.textContent = SHARE.stop;
  }
}
