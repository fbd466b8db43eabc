// The worker: starts it, sends it messages, and says when it has stopped for good.

import type { Failure, FromWorker, ToWorker } from "./protocol";

export class Engine {
  #worker: Worker;
  readonly #receive: (message: FromWorker) => void;

  constructor(receive: (message: FromWorker) => void) {
    this.#receive = receive;
    this.#worker = this.#start();
  }

  send(message: ToWorker, transfer: Transferable[] = []): void {
    this.#worker.postMessage(message, transfer);
  }

  // A worker that has failed cannot go on; a new one can.
  restart(): void {
    this.#worker.terminate();
    this.#worker = this.#start();
  }

  #start(): Worker {
    const worker = new Worker(new URL("./worker.ts", import.meta.url), { type: "module" });
    // A panic tells its reason in a message, and then shows as an error too.
    let hasTold = false;
    worker.onmessage = ({ data }: MessageEvent<FromWorker>) => {
      hasTold ||= data.kind === "failure" && data.code.startsWith("engine_");
      this.#receive(data);
    };
    worker.onerror = (event) => {
      event.preventDefault();
      if (!hasTold) this.#receive(stopped(event.message));
    };
    return worker;
  }
}

function stopped(message: string | undefined): Failure {
  return {
    kind: "failure",
    code: "engine_stopped",
    cause: message ? `The simulation stopped: ${message}` : "The simulation did not start.",
    cure: "Restart it; the page itself is unharmed.",
  };
}
