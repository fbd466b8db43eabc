// The server's stream of what its jobs do, heard for as long as somebody looks: browsers keep few connections to a
// server, and many pages that nobody sees would take all of them.

import { API } from "./api";

// A stream that the server ended is opened again after this (ms); one that broke comes back by itself.
const AGAIN = 2000;

export interface Listens<Event> {
  // Whether it goes on after the last event that came, or from now on.
  goesOn: boolean;
  // From now on nothing is missed; something may have been before.
  opened(): void;
  received(event: Event): void;
  lost?(): void;
}

export class Stream<Event extends { id: string }> {
  readonly #types: readonly string[];
  readonly #listens: Listens<Event>;
  #source: EventSource | null = null;
  // The last event that came.
  #last: string | null = null;
  #isOver = false;

  constructor(types: readonly string[], listens: Listens<Event>) {
    [this.#types, this.#listens] = [types, listens];
    document.addEventListener("visibilitychange", () => (document.hidden ? this.#close() : this.#open()));
    this.#open();
  }

  end(): void {
    this.#isOver = true;
    this.#close();
  }

  #close(): void {
    this.#source?.close();
    this.#source = null;
  }

  #open(): void {
    if (document.hidden || this.#isOver || this.#source) return;
    const after = this.#listens.goesOn && this.#last ? `?after=${this.#last}` : "";
    const source = new EventSource(new URL(`stream${after}`, API));
    this.#source = source;
    source.onopen = () => this.#listens.opened();
    source.onerror = () => {
      this.#listens.lost?.();
      if (source.readyState !== EventSource.CLOSED || this.#source !== source) return;
      this.#source = null;
      setTimeout(() => this.#open(), AGAIN);
    };
    for (const type of this.#types) {
      source.addEventListener(type, ({ data }) => {
        const event = JSON.parse(data) as Event;
        this.#last = event.id;
        this.#listens.received(event);
      });
    }
  }
}
