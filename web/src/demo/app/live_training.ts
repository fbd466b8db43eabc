// Live training: loads each new checkpoint of a running job and repeats the attempt with it.

import { type List, requestJson } from "../../common/api";
import { element } from "../../common/dom";
import { EventStream } from "../../common/event_stream";
import type { Frame, Model } from "../worker/protocol";
import type { EventBus } from "./event_bus";
import { TRAINING } from "./strings";

// Time from an outcome to the next policy, long enough to be seen (ms).
const PAUSE_MS = 2500;

interface Checkpoint {
  step: number;
  model_id: string;
}

export interface LiveTrainingEvents {
  // Load this model, unless an attempt is running when the download completes.
  load(model: string): void;
  grasp(): void;
}

export class LiveTraining {
  readonly #job: string;
  readonly #events: LiveTrainingEvents;
  readonly #section = element("training", HTMLElement);
  readonly #follow = element("training-follow", HTMLInputElement);
  readonly #status = element("training-status", HTMLElement);
  readonly #stream: EventStream<{ id: string; job: string }>;
  #isFinished = false;
  #newest: Checkpoint | null = null;
  // Steps of the known checkpoints by model id.
  readonly #steps = new Map<string, number>();
  // Newest step when the page was opened. Checkpoints up to this one are not loaded automatically.
  #initialStep: number | null = null;
  // Ids of the active model and of the one that was requested.
  #active: string | null = null;
  #requested: string | null = null;
  // Whether no attempt is running and the last outcome was shown long enough.
  #isIdle = false;
  #timer = 0;

  constructor(bus: EventBus, job: string, events: LiveTrainingEvents) {
    this.#job = job;
    this.#events = events;
    this.#follow.addEventListener("change", () => this.#loadNewest());
    this.#stream = new EventStream(["checkpoint", "status"], {
      resumes: false,
      onOpen: () => void this.#refresh(),
      onLost: () => (this.#status.textContent = TRAINING.lost),
      onEvent: (event) => void (event.job === this.#job && this.#refresh()),
    });
    bus.on("frame", (frame) => this.#showFrame(frame));
    // No model was loaded during the batch.
    bus.on("batchFinished", () => this.#loadNewest());
  }

  // Fetches the checkpoints and the status of the job.
  async #refresh(): Promise<void> {
    try {
      const { data } = await requestJson<List<Checkpoint>>(`jobs/${this.#job}/checkpoints`);
      const { finished_at } = await requestJson<{ finished_at: string | null }>(`jobs/${this.#job}`);
      // Responses can arrive out of order, so the state only advances.
      this.#isFinished ||= finished_at !== null;
      for (const { step, model_id } of data) this.#steps.set(model_id, step);
      this.#newest = data.reduce((newest, next) => (newest && newest.step >= next.step ? newest : next), this.#newest);
    } catch {
      // The job was deleted, or the request is repeated when the server is back.
      return;
    }
    if (this.#initialStep === null) {
      this.#initialStep = this.#newest?.step ?? 0;
      this.#section.hidden = this.#isFinished;
    }
    if (this.#isFinished) this.#stream.end();
    this.#showStatus();
    this.#loadNewest();
  }

  // The user has selected another policy.
  leave(): void {
    this.#follow.checked = false;
    this.#requested = null;
  }

  // A running or just finished attempt is not interrupted.
  #showFrame({ phase }: Frame): void {
    if (phase !== "idle" && phase !== "outcome") {
      clearTimeout(this.#timer);
      [this.#timer, this.#isIdle, this.#requested] = [0, false, null];
    } else if (!this.#timer) {
      this.#timer = window.setTimeout(() => {
        this.#isIdle = true;
        this.#loadNewest();
      }, PAUSE_MS);
    }
  }

  hasModel({ id }: Model): void {
    const wasRequested = id !== null && id === this.#requested;
    [this.#active, this.#requested] = [id, null];
    this.#showStatus();
    if (wasRequested && this.#isIdle) this.#events.grasp();
  }

  // One download at a time: on a slow connection, checkpoints appear faster than they are downloaded.
  #loadNewest(): void {
    if (this.#requested !== null) return;
    const { step, model_id: id } = this.#newest ?? { step: 0, model_id: null };
    const isNew = this.#initialStep !== null && step > this.#initialStep && id !== this.#active;
    if (!id || !isNew || !this.#active || !this.#isIdle || !this.#follow.checked) return;
    this.#requested = id;
    this.#events.load(id);
  }

  #showStatus(): void {
    if (!this.#newest) return;
    const newest = this.#newest.step;
    const used = this.#steps.get(this.#active ?? "");
    const text = used === newest ? TRAINING.usingLatest(stepText(newest)) : TRAINING.latest(stepText(newest), used && stepText(used));
    this.#status.textContent = this.#isFinished ? `${text} ${TRAINING.finished}` : text;
  }
}

const stepText = (step: number) => step.toLocaleString("en");
