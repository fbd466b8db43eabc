// Event stream of the server (server-sent events), open while the page is visible. Browsers allow few connections per
// server, and hidden tabs would use them up.

import { API } from "./api";

// Delay before reopening a stream that the server closed (ms). The browser reopens broken ones.
const REOPEN_DELAY = 2000;

export interface StreamOptions<Event> {
  // Reopen after the last received event instead of at the newest one.
  resumes: boolean;
  // Called when the stream is open. Earlier events may have been missed.
  onOpen(): void;
  onEvent(event: Event): void;
  onLost?(): void;
}

export class EventStream<Event extends { id: string }> {
  readonly #types: readonly string[];
  readonly #options: StreamOptions<Event>;
  #source: EventSource | null = null;
  #lastEventId: string | null = null;
  #isEnded = false;

  constructor(types: readonly string[], options: StreamOptions<Event>) {
    [this.#types, this.#options] = [types, options];
    document.addEventListener("visibilitychange", () => (document.hidden ? this.#close() : this.#open()));
    this.#open();
  }

  end(): void {
    this.#isEnded = true;
    this.#close();
  }

  #close(): void {
    this.#source?.close();
    this.#source = null;
  }

  #open(): void {
    if (document.hidden || this.#isEnded || this.#source) return;
    const after = this.#options.resumes && this.#lastEventId ? `?after=${this.#lastEventId}` : "";
    const source = new EventSource(new URL(`stream${after}`, API));
    this.#source = source;
    source.onopen = () => this.#options.onOpen();
    source.onerror = () => {
      this.#options.onLost?.();
      if (source.readyState !== EventSource.CLOSED || this.#source !== source) return;
      this.#source = null;
      setTimeout(() => this.#open(), REOPEN_DELAY);
    };
    for (const type of this.#types) {
      source.addEventListener(type, ({ data }) => {
        const event = JSON.parse(data) as Event;
        this.#lastEventId = event.id;
        this.#options.onEvent(event);
      });
    }
  }
}
