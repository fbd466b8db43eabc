// What the process of a job printed: its end, then what comes.

import { API, Refused, send } from "../common/api";
import { h } from "../common/dom";
import type { Feed } from "./feed";
import { LOG } from "./strings";
import { ENDED, type Job } from "./types";

// Bytes of the end that are fetched first, and how often more is asked for (ms).
const END = 64_000;
const PERIOD = 2000;
// Lines that are kept in the page.
const MOST = 5000;

// Lines that are enough to see why a process ended.
const LAST = 8;

// What the process of a job printed last, "" if nothing is known of it.
export async function lastLines(job: string): Promise<string> {
  try {
    return (await (await send(`jobs/${job}/logs?tail=${LAST}`)).text()).trimEnd();
  } catch {
    return "";
  }
}

export class Log {
  readonly element: HTMLElement;
  readonly #lines = h("pre", { class: "log", tabindex: 0, role: "log", "aria-label": LOG.title });
  readonly #level: HTMLSelectElement;
  readonly #search: HTMLInputElement;
  readonly #follow: HTMLInputElement;
  readonly #id: string;
  readonly #feed: Feed;
  readonly #stop: () => void;
  #text: string[] = [""];
  #decoder = new TextDecoder();
  #next = -1;
  #timer = 0;
  // All was read of a job that is over.
  #isAtRest = false;
  #isClosed = false;

  constructor(feed: Feed, job: Job) {
    this.#feed = feed;
    this.#id = job.id;
    this.#level = h(
      "select",
      { "aria-label": LOG.lines, change: () => this.#draw() },
      h("option", { value: "" }, LOG.all),
      h("option", { value: "warning|error|panicked" }, LOG.warnings),
    );
    this.#search = h("input", { type: "search", placeholder: LOG.search, "aria-label": LOG.searchIt, input: () => this.#draw() });
    this.#follow = h("input", { type: "checkbox", checked: true, change: () => this.#draw() });
    const url = new URL(`jobs/${job.id}/logs`, API).href;
    this.element = h(
      "section",
      {},
      h("h2", {}, LOG.title),
      h(
        "div",
        { class: "controls" },
        this.#level,
        this.#search,
        h("label", {}, this.#follow, LOG.follow),
        h("a", { href: url, download: `${job.id}.txt` }, LOG.download),
      ),
      this.#lines,
    );
    // A job that goes on says more.
    this.#stop = feed.listen({
      jobs: (changed) => changed.has(job.id) && this.#isAtRest && !this.#isOver() && void this.#fetch(),
    });
    void this.#fetch();
  }

  close(): void {
    this.#isClosed = true;
    this.#stop();
    clearTimeout(this.#timer);
  }

  // One that is gone is over, too.
  #isOver(): boolean {
    const job = this.#feed.jobs.get(this.#id);
    return !job || ENDED.includes(job.status);
  }

  async #fetch(): Promise<void> {
    this.#isAtRest = false;
    // Known before: what is printed while the answer comes is not in it.
    const wasOver = this.#isOver();
    let isAnswered = true;
    // With the last byte that is known, so that there always is something to answer with.
    const range = this.#next > 0 ? `bytes=${this.#next - 1}-` : `bytes=-${END}`;
    try {
      const answer = await send(`jobs/${this.#id}/logs`, "GET", undefined, { headers: { Range: range } });
      const bytes = new Uint8Array(await answer.arrayBuffer());
      const first = Number(/bytes (\d+)-/.exec(answer.headers.get("content-range") ?? "")?.[1] ?? 0);
      // An answer that is whole replaces what was there.
      const known = answer.status === 206 && this.#next > 0 ? this.#next - first : 0;
      if (known === 0) [this.#text, this.#decoder] = [[""], new TextDecoder()];
      this.#next = first + bytes.byteLength;
      // The end of it may be a part of a letter.
      this.#add(this.#decoder.decode(bytes.subarray(known), { stream: true }));
    } catch (error) {
      // A server that is away is asked again.
      isAnswered = error instanceof Refused && error.problem.status > 0;
    }
    this.#isAtRest = wasOver && isAnswered && this.#isOver();
    if (!this.#isAtRest && !this.#isClosed) this.#timer = window.setTimeout(() => void this.#fetch(), PERIOD);
  }

  #add(text: string): void {
    const [first = "", ...rest] = text.split("\n");
    this.#text[this.#text.length - 1] += first;
    this.#text.push(...rest);
    this.#text.splice(0, Math.max(0, this.#text.length - MOST));
    this.#draw();
  }

  #draw(): void {
    const level = new RegExp(this.#level.value, "i");
    const wanted = this.#search.value.toLowerCase();
    const shown = this.#text.filter((line) => level.test(line) && line.toLowerCase().includes(wanted));
    const [before, text] = [this.#lines.textContent ?? "", shown.join("\n").trimEnd() || LOG.none];
    // What is new is appended: a selection stays, and only that is read out.
    const isMore = before !== "" && before !== LOG.none && text.startsWith(before);
    if (isMore && text !== before) this.#lines.append(text.slice(before.length));
    else if (!isMore) this.#lines.textContent = text;
    if (this.#follow.checked) this.#lines.scrollTop = this.#lines.scrollHeight;
  }
}
