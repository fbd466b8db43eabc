// A second policy beside the first: the same object, pose and seed in a worker and a picture of its own.

import { element } from "../common/dom";
import { Engine, givenUp, isEnd, useModel } from "./engine";
import { fillWhenWanted } from "./policies";
import type { Attempted, Failure, FromWorker, ToWorker, Verdict } from "./protocol";
import { COMPARISON } from "./strings";
import type { Layer, View } from "./view/view";

export interface ComparisonEvents {
  // What a worker must be told to stand where the first one does.
  now(): ToWorker[];
  // The second picture, if there can be one.
  picture(): View | null;
  // Where the viewer of the first one stands.
  stand(): number[] | null;
  // How the second policy did in a row of attempts, and that a row is over; null is whichever it was.
  attempted(row: Attempted): void;
  over(run: number | null): void;
  tell(failure: Failure): void;
}

// What the second worker is not asked for.
const ALONE = new Set<ToWorker["kind"]>(["model", "export", "watch", "search", "follow"]);

// What ends an attempt, and its verdict with it.
const ENDS = new Set<ToWorker["kind"]>(["load", "upload", "place", "randomPose", "grasp", "reset"]);

export class Comparison {
  readonly #events: ComparisonEvents;
  readonly #choice = element("compare", HTMLSelectElement);
  readonly #names = [element("who-1", HTMLElement), element("who-2", HTMLElement)] as const;
  #engine: Engine | null = null;
  #view: View | null = null;
  #first = "";
  // Whether the second policy is there, and the attempt that waits for it: begun before, it would be the planner's.
  #isReady = false;
  #grasp: ToWorker | null = null;
  // The attempt that was asked for last, if nothing has ended it since.
  #attempt: ToWorker | null = null;

  constructor(events: ComparisonEvents) {
    this.#events = events;
    this.#choice.addEventListener("change", () => this.#start(this.#choice.value));
    fillWhenWanted(this.#choice);
  }

  // Who acts in the first picture.
  name(id: string | null): void {
    this.#first = id ?? COMPARISON.planner;
    this.#names[0].textContent = this.#first;
  }

  // Who takes part in a row of attempts.
  get names(): string[] {
    const second = this.#choice.value;
    if (!this.#engine || !this.#isReady) return [this.#first];
    return [this.#first, second === this.#first ? COMPARISON.again(second) : second];
  }

  // Whatever the first worker is told.
  send(message: ToWorker): void {
    // What plays there is no longer what ended.
    if (message.kind === "follow") this.#names[0].textContent = this.#first;
    if (ALONE.has(message.kind) || !this.#engine) return;
    // A row that began without it stays so: its attempts would be the planner's.
    if (message.kind === "batch" && !this.#isReady) return;
    if (ENDS.has(message.kind)) [this.#grasp, this.#attempt] = [null, message.kind === "grasp" ? message : null];
    if (message.kind === "grasp" && !this.#isReady) this.#grasp = message;
    else this.#engine.send(message);
    if (ENDS.has(message.kind)) this.#showNames();
  }

  // How the object lies, of which the first worker has judged; what was asked for since it was brought is of that.
  lay(object: ToWorker): void {
    const attempt = this.#attempt;
    this.send(object);
    if (attempt) this.send(attempt);
  }

  // The first one is begun anew, and stands as it did.
  restart(): void {
    if (this.#engine) this.#start(this.#choice.value);
  }

  // How the first one ended, or what was played there.
  showVerdict({ words, played }: Verdict): void {
    this.#names[0].textContent = `${played?.what ?? this.#first}: ${words}`;
  }

  // The viewer of the first picture has moved.
  stand(numbers: number[]): void {
    if (this.#engine) this.#view?.standAt(numbers);
  }

  setLayer(layer: Layer, on: boolean): void {
    this.#view?.setLayer(layer, on);
  }

  #showNames(): void {
    this.#names[0].textContent = this.#first;
    const second = this.#choice.value;
    this.#names[1].textContent = this.#isReady || second === "" ? second : COMPARISON.loading(second);
  }

  #start(id: string): void {
    if (this.#engine) this.#events.over(null);
    this.#engine?.stop();
    [this.#engine, this.#isReady, this.#grasp, this.#attempt] = [null, false, null, null];
    document.body.classList.toggle("is-compared", id !== "");
    this.#showNames();
    if (id === "") return;
    this.#view ??= this.#events.picture();
    const engine = new Engine(useModel(id), (message) => this.#receive(message));
    this.#engine = engine;
    for (const message of this.#events.now()) engine.send(message);
  }

  #begin(): void {
    this.#isReady = true;
    this.#showNames();
    if (this.#grasp) this.#engine?.send(this.#grasp);
    this.#grasp = null;
  }

  #receive(message: FromWorker): void {
    const view = this.#view;
    switch (message.kind) {
      case "ready": {
        view?.show(message);
        const stand = this.#events.stand();
        if (stand) view?.standAt(stand);
        break;
      }
      case "object":
        view?.showObject(message);
        break;
      case "frame":
        view?.showFrame(message);
        break;
      case "cloud":
        view?.showCloud(message);
        break;
      case "model":
        // What failed is told already.
        if (message.id === null) this.#start((this.#choice.value = ""));
        else this.#begin();
        break;
      case "verdict":
        this.#names[1].textContent = `${message.played?.what ?? this.#choice.value}: ${message.words}`;
        break;
      case "attempted":
        this.#events.attempted(message);
        break;
      case "batchOver":
        this.#events.over(message.run);
        break;
      case "failure":
        if (isEnd(message)) this.#start((this.#choice.value = ""));
        this.#events.tell(givenUp(message, COMPARISON.givenUp));
        break;
    }
  }
}
