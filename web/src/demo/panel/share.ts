// Share section: link to an attempt, and downloads of image, video and episode.

import { ApiError, requestJson } from "../../common/api";
import { copyText, element } from "../../common/dom";
import type { EventBus } from "../app/event_bus";
import { SHARE } from "../app/strings";
import { download } from "../files/download";
import { VIDEO_FORMAT } from "../files/video_format";
import { buildLink, type ShareLink } from "../share/share_link";
import type { ImportOptions } from "../worker/messages";
import type { Frame, Model, ObjectLoaded, Outcome } from "../worker/protocol";

// Size of a film without frames: only headers (bytes).
const EMPTY_VIDEO_BYTES = 1000;

export interface ShareEvents {
  // Camera position and orbit target; null without a view.
  view(): number[] | null;
  screenshot(): Promise<Blob | null>;
  canvas(): HTMLCanvasElement;
  // The canvas is being recorded, or no longer.
  setRecorded(on: boolean): void;
  // Plays the finished attempt from its first tick.
  replay(): void;
  exportRecording(): void;
  // Import options of the current mesh file.
  options(): ImportOptions | null;
  // The current mesh file; null for a built-in object.
  file(): File | null;
}

export class SharePanel {
  readonly #events: ShareEvents;
  readonly #link = element("copy-link", HTMLButtonElement);
  readonly #video = element("save-webm", HTMLButtonElement);
  readonly #episode = element("save-json", HTMLButtonElement);
  readonly #store = element("store", HTMLButtonElement);
  readonly #hint = element("share-hint", HTMLElement);
  // Id of the mesh on the server.
  #mesh: string | null = null;
  #sceneHash = "";
  #object: ObjectLoaded | null = null;
  #model: Model | null = null;
  #frame: Frame | null = null;
  #outcome: Outcome | null = null;
  #upload: AbortController | null = null;
  #recorder: MediaRecorder | null = null;

  constructor(bus: EventBus, events: ShareEvents) {
    this.#events = events;
    this.#link.addEventListener("click", () => void this.copy());
    element("save-png", HTMLButtonElement).addEventListener("click", () => void this.#saveImage());
    this.#video.addEventListener("click", () => this.#toggleVideo());
    this.#video.hidden = !VIDEO_FORMAT;
    this.#episode.addEventListener("click", () => events.exportRecording());
    this.#store.addEventListener("click", () => void this.#storeMesh());
    bus.on("ready", ({ sceneHash }) => (this.#sceneHash = sceneHash));
    bus.on("object", (object) => this.#showObject(object));
    bus.on("modelChanged", ({ model }) => this.#showModel(model));
    bus.on("frame", (frame) => this.#showFrame(frame));
    bus.on("outcome", (outcome) => this.#setOutcome(outcome));
  }

  #showObject(object: ObjectLoaded): void {
    [this.#object, this.#mesh] = [object, null];
    // An upload in progress is of the previous file.
    this.#store.hidden = true;
    this.#upload?.abort();
    this.#setOutcome(null);
  }

  #showModel(model: Model): void {
    this.#model = model;
    // Playback does not depend on the policy.
    if (!this.#outcome?.playback) this.#setOutcome(null);
  }

  #showFrame(frame: Frame): void {
    this.#frame = frame;
    // A new attempt has started. An attempt that fails at once already has its outcome.
    if (this.#outcome && frame.ticks === 0 && frame.phase !== "outcome") this.#setOutcome(null);
  }

  // Null: no attempt has finished.
  #setOutcome(outcome: Outcome | null): void {
    this.#outcome = outcome;
    // A link reproduces neither a playback nor an attempt of the planner.
    const isOfPolicy = outcome !== null && !outcome.playback && this.#model?.id != null;
    const why = outcome?.disturbed ? SHARE.disturbed : outcome && !isOfPolicy ? SHARE.noPolicy : null;
    this.#link.disabled = !isOfPolicy || outcome.disturbed;
    this.#episode.disabled = !outcome || outcome.disturbed;
    // Screen readers announce a text whenever it is set, even if it is unchanged.
    const hint = why ?? SHARE.hint;
    if (this.#hint.textContent !== hint) this.#hint.textContent = hint;
  }

  async copy(): Promise<void> {
    const [object, model, outcome, frame] = [this.#object, this.#model, this.#outcome, this.#frame];
    if (this.#link.disabled || !object || !model?.id || !outcome || !frame) return;
    const options = this.#events.options();
    const link: ShareLink = {
      object: object.name ?? object.label,
      objectHash: object.hash,
      // Unit and orientation are stated, since another version might choose them differently. A size replaces the unit.
      options: options && { ...options, unit: options.sizeM === null ? object.info.unit : null, orientation: object.info.orientation },
      mesh: this.#mesh,
      pose: outcome.pose,
      placedByHand: outcome.placedByHand,
      seed: outcome.seed,
      model: model.id,
      modelHash: model.hash,
      sceneHash: this.#sceneHash,
      view: this.#events.view(),
      tick: frame.tick < frame.ticks ? frame.tick : null,
      finalStateHash: outcome.finalStateHash,
    };
    const url = buildLink(link);
    const needsFile = object.name === null && this.#mesh === null;
    this.#store.hidden = !needsFile;
    const isCopied = await copyText(this.#hint, url);
    this.#hint.textContent = isCopied ? (needsFile ? SHARE.copiedWithoutFile : SHARE.copied) : url;
    if (!isCopied) getSelection()?.selectAllChildren(this.#hint);
  }

  // Stores the mesh on the server, so that the link is sufficient. A second click cancels the upload.
  async #storeMesh(): Promise<void> {
    if (this.#upload) return this.#upload.abort();
    const file = this.#events.file();
    if (!file) return;
    this.#upload = new AbortController();
    const label = this.#store.textContent;
    this.#store.textContent = SHARE.cancelUpload;
    this.#hint.textContent = SHARE.uploading(file.name);
    const { signal } = this.#upload;
    try {
      const { limits } = await requestJson<{ limits: { mesh_bytes: number } }>("../v1", "GET", undefined, { signal });
      if (file.size > limits.mesh_bytes) {
        this.#hint.textContent = SHARE.notStored(SHARE.tooLarge(file.name, limits.mesh_bytes / 1e6));
        return;
      }
      const path = `meshes?name=${encodeURIComponent(file.name)}`;
      const { id } = await requestJson<{ id: string }>(path, "POST", file, { signal });
      this.#mesh = id;
      this.#store.hidden = true;
      this.#hint.textContent = SHARE.stored;
      // Replaces the hint if the link is still available.
      await this.copy();
    } catch (error) {
      const hasServer = error instanceof ApiError && error.problem.code !== "no_server";
      const why = hasServer ? error.problem.detail.replace(/\.$/, "") : SHARE.noServer;
      this.#hint.textContent = signal.aborted ? SHARE.uploadCancelled : SHARE.notStored(why);
    } finally {
      this.#upload = null;
      this.#store.textContent = label;
    }
  }

  async #saveImage(): Promise<void> {
    const image = await this.#events.screenshot();
    if (image) download("ngf-grasp.png", image);
  }

  // Starts recording the canvas, or stops and downloads the video. A finished attempt is played again, since nothing
  // moves after it.
  #toggleVideo(): void {
    if (this.#recorder) return this.#recorder.stop();
    try {
      this.#events.setRecorded(true);
      this.#recorder = this.#record();
    } catch (error) {
      this.#events.setRecorded(false);
      this.#hint.textContent = SHARE.noVideo(String(error));
      return;
    }
    this.#video.textContent = SHARE.stop;
    if (this.#frame?.phase === "outcome") this.#events.replay();
  }

  #record(): MediaRecorder {
    const chunks: Blob[] = [];
    const type = `video/${VIDEO_FORMAT}`;
    const recorder = new MediaRecorder(this.#events.canvas().captureStream(30), { mimeType: type });
    let reason: string = SHARE.noFrames;
    recorder.ondataavailable = ({ data }) => chunks.push(data);
    recorder.onerror = (event) => (reason = String((event as ErrorEvent).error ?? reason));
    recorder.onstop = () => {
      this.#recorder = null;
      this.#events.setRecorded(false);
      this.#video.textContent = SHARE.video;
      const film = new Blob(chunks, { type });
      if (film.size > EMPTY_VIDEO_BYTES) download(`ngf-grasp.${VIDEO_FORMAT}`, film);
      else this.#hint.textContent = SHARE.noVideo(reason);
    };
    recorder.start();
    return recorder;
  }
}
