// Without learning: grasps of the object searched in physics, in a worker of its own, and the best one played.

import { element } from "../../common/dom";
import { Engine, givenUp } from "../engine";
import type { Failure, Found, FromWorker, ToWorker } from "../protocol";
import { SEARCH } from "../strings";

export interface SearchEvents {
  // What a worker must be told to stand where the first one does.
  now(): ToWorker[];
  seed(): number;
  // Plays these grasps of the object with this hash.
  follow(found: Found): void;
  tell(failure: Failure): void;
}

export class SearchPanel {
  readonly #events: SearchEvents;
  readonly #button = element("search", HTMLButtonElement);
  readonly #bar = element("search-bar", HTMLProgressElement);
  readonly #words = element("search-words", HTMLElement);
  #engine: Engine | null = null;
  // Grasps of the object that stands there, once they are found.
  #grasps: Found | null = null;

  constructor(events: SearchEvents) {
    this.#events = events;
    this.#button.addEventListener("click", () => {
      if (this.#engine) this.#stop(SEARCH.stopped);
      else if (this.#grasps) events.follow(this.#grasps);
      else this.#begin();
    });
    this.clear();
  }

  // Another object: what was found is not of it.
  clear(): void {
    this.#grasps = null;
    this.#button.disabled = this.#events.now().length === 0;
    this.#stop(SEARCH.hint);
  }

  #begin(): void {
    const [object, ...more] = this.#events.now();
    if (!object) return;
    const engine = new Engine(object, (message) => this.#receive(message));
    this.#engine = engine;
    for (const message of more) engine.send(message);
    engine.send({ kind: "search", seed: this.#events.seed() });
    this.#button.textContent = SEARCH.stop;
    this.#bar.hidden = false;
    this.#bar.removeAttribute("value");
    this.#words.textContent = SEARCH.trying;
  }

  #stop(words: string): void {
    this.#engine?.stop();
    this.#engine = null;
    this.#bar.hidden = true;
    this.#button.textContent = this.#grasps ? SEARCH.again : SEARCH.begin;
    this.#words.textContent = words;
  }

  #receive(message: FromWorker): void {
    if (message.kind === "progress" && message.total !== null) {
      [this.#bar.max, this.#bar.value] = [message.total, message.done];
    } else if (message.kind === "found") {
      this.#grasps = message.count > 0 ? message : null;
      this.#stop(message.words);
      if (this.#grasps) this.#events.follow(this.#grasps);
    } else if (message.kind === "failure") {
      this.#stop(SEARCH.hint);
      this.#events.tell(givenUp(message, SEARCH.givenUp));
    }
  }
}
