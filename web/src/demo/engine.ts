// The worker: starts it, sends it messages, and says when it has stopped for good.

import { takeWorker } from "./first";
import type { Failure, FromWorker, ToWorker } from "./protocol";
import { FAILURES } from "./strings";

// What tells a worker by whom to act.
export function useModel(id: string, gently = false): ToWorker {
  return { kind: "model", id, base: new URL(".", document.baseURI).href, gently };
}

// Whether a worker that says so is of no more use.
export function isEnd({ code }: Failure): boolean {
  return code.startsWith("engine_");
}

// A policy could not be fetched, and may be another time.
export const NOT_FETCHED = "model_not_fetched";

// The same of a worker beside the first, which whoever had begun it has given up: there is nothing to do again.
export function givenUp(failure: Failure, cure: string): Failure {
  return isEnd(failure) || failure.code === NOT_FETCHED ? { ...failure, code: `second_${failure.code}`, cure } : failure;
}

export class Engine {
  #worker: Worker;
  // A worker hears nothing before it is ready: what is said meanwhile is kept.
  #waiting: ToWorker[] | null;
  #greeting: ToWorker;
  readonly #receive: (message: FromWorker) => void;

  // Every worker is told the greeting first.
  constructor(greeting: ToWorker, receive: (message: FromWorker) => void) {
    this.#greeting = greeting;
    this.#waiting = [greeting];
    this.#receive = receive;
    this.#worker = this.#start();
  }

  // Bytes are copied: others may be told the same.
  send(message: ToWorker): void {
    if (this.#waiting) this.#waiting.push(message);
    else this.#worker.postMessage(message);
  }

  // What later workers are told first, too.
  greet(greeting: ToWorker): void {
    this.#greeting = greeting;
    if (this.#waiting) this.#waiting[0] = greeting;
    else this.send(greeting);
  }

  // The same without telling this one, which does so already.
  keep(greeting: ToWorker): void {
    this.#greeting = greeting;
  }

  // Nobody listens any more.
  stop(): void {
    this.#worker.terminate();
  }

  // A worker that has failed cannot go on; a new one can.
  restart(): void {
    this.#worker.terminate();
    this.#waiting = [this.#greeting];
    this.#worker = this.#start();
  }

  #deliver(): void {
    const waiting = this.#waiting ?? [];
    this.#waiting = null;
    for (const message of waiting) this.#worker.postMessage(message);
  }

  #start(): Worker {
    // A panic tells its reason in a message, and then shows as an error too.
    let hasTold = false;
    const heard = ({ data }: MessageEvent<FromWorker>) => {
      hasTold ||= data.kind === "failure" && isEnd(data);
      this.#receive(data);
      if (data.kind === "ready") this.#deliver();
    };
    return takeWorker(heard, (event) => {
      event.preventDefault();
      if (!hasTold) this.#receive({ kind: "failure", code: "engine_stopped", ...FAILURES.stopped(event.message) });
    });
  }
}
