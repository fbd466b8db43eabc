// A training whose policy acts here while it goes on: what it has learned since acts next, in the same attempt again.

import { ask, type List } from "../common/api";
import { element } from "../common/dom";
import { Stream } from "../common/stream";
import type { Frame, Model } from "./protocol";
import { TRAINING } from "./strings";

// From a verdict to the next policy, long enough to be seen (ms).
const PAUSE = 2500;

interface Checkpoint {
  step: number;
  model_id: string;
}

export interface TrainingEvents {
  // This one is to act, unless something is under way when it has come.
  use(model: string): void;
  grasp(): void;
}

export class Training {
  readonly #job: string;
  readonly #events: TrainingEvents;
  readonly #part = element("training", HTMLElement);
  readonly #box = element("training-follow", HTMLInputElement);
  readonly #words = element("training-words", HTMLElement);
  readonly #stream: Stream<{ id: string; job: string }>;
  #isOver = false;
  #newest: Checkpoint | null = null;
  // The last step that was written before the page was opened: who chose one of those did not choose a newer one.
  #before: number | null = null;
  // What acts, and what was asked for in its place.
  #acts: string | null = null;
  #awaited: string | null = null;
  // Whether nothing is under way, and what ended has been seen.
  #isIdle = false;
  #timer = 0;

  constructor(job: string, events: TrainingEvents) {
    this.#job = job;
    this.#events = events;
    this.#box.addEventListener("change", () => this.#go());
    this.#stream = new Stream(["checkpoint", "status"], {
      goesOn: false,
      opened: () => void this.#catchUp(),
      lost: () => (this.#words.textContent = TRAINING.lost),
      received: (event) => void (event.job === this.#job && this.#catchUp()),
    });
  }

  // What it has written so far, and whether it goes on.
  async #catchUp(): Promise<void> {
    try {
      const { data } = await ask<List<Checkpoint>>(`jobs/${this.#job}/checkpoints`);
      const { finished_at } = await ask<{ finished_at: string | null }>(`jobs/${this.#job}`);
      // An answer may be overtaken by a later one.
      this.#isOver ||= finished_at !== null;
      this.#newest = data.reduce((newest, one) => (newest && newest.step >= one.step ? newest : one), this.#newest);
    } catch {
      // It was deleted, or is asked for again when the server is back.
      return;
    }
    if (this.#before === null) {
      this.#before = this.#newest?.step ?? 0;
      this.#part.hidden = this.#isOver;
    }
    if (this.#isOver) this.#stream.end();
    this.#tell();
    this.#go();
  }

  // Somebody has chosen another policy, and wants to keep it.
  leave(): void {
    this.#box.checked = false;
    this.#awaited = null;
  }

  // An attempt that is under way, or has just ended, is not cut short.
  showFrame({ phase }: Frame): void {
    if (phase !== "idle" && phase !== "verdict") {
      clearTimeout(this.#timer);
      [this.#timer, this.#isIdle, this.#awaited] = [0, false, null];
    } else if (!this.#timer) {
      this.#timer = window.setTimeout(() => {
        this.#isIdle = true;
        this.#go();
      }, PAUSE);
    }
  }

  hasModel({ id }: Model): void {
    const isOurs = id !== null && id === this.#awaited;
    [this.#acts, this.#awaited] = [id, null];
    this.#tell();
    if (isOurs && this.#isIdle) this.#events.grasp();
  }

  // What was in the way is over.
  tryAgain(): void {
    this.#go();
  }

  // One at a time: on a slow line checkpoints come faster than they are fetched.
  #go(): void {
    if (this.#awaited !== null) return;
    const { step, model_id: id } = this.#newest ?? { step: 0, model_id: null };
    const isNews = this.#before !== null && step > this.#before && id !== this.#acts;
    if (!id || !isNews || !this.#acts || !this.#isIdle || !this.#box.checked) return;
    this.#awaited = id;
    this.#events.use(id);
  }

  #tell(): void {
    if (!this.#newest) return;
    const { step, model_id } = this.#newest;
    const words = (model_id === this.#acts ? TRAINING.acts : TRAINING.newest)(step.toLocaleString("en"));
    this.#words.textContent = this.#isOver ? `${words} ${TRAINING.over}` : words;
  }
}
