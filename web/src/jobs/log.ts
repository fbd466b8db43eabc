// Log of a job: its last bytes, then new output.

import { API, ApiError, request } from "../common/api";
import { h } from "../common/dom";
import type { JobFeed } from "./job_feed";
import { LOG } from "./strings";
import { ENDED, type Job } from "./types";

const INITIAL_BYTES = 64_000;
const POLL_INTERVAL_MS = 2000;
const MAX_LINES = 5000;

// Number of lines shown with the error of a failed job.
const ERROR_LINES = 8;

// Last lines of a job's log; empty if there are none.
export async function lastLines(job: string): Promise<string> {
  try {
    return (await (await request(`jobs/${job}/logs?tail=${ERROR_LINES}`)).text()).trimEnd();
  } catch {
    return "";
  }
}

export class Log {
  readonly element: HTMLElement;
  readonly #output = h("pre", { class: "log", tabindex: 0, role: "log", "aria-label": LOG.title });
  readonly #level: HTMLSelectElement;
  readonly #search: HTMLInputElement;
  readonly #follow: HTMLInputElement;
  readonly #id: string;
  readonly #feed: JobFeed;
  readonly #unsubscribe: () => void;
  #lines: string[] = [""];
  #decoder = new TextDecoder();
  #nextByte = -1;
  #timer = 0;
  // The log of an ended job has been read completely.
  #isComplete = false;
  #isClosed = false;

  constructor(feed: JobFeed, job: Job) {
    this.#feed = feed;
    this.#id = job.id;
    this.#level = h(
      "select",
      { "aria-label": LOG.lines, change: () => this.#draw() },
      h("option", { value: "" }, LOG.all),
      h("option", { value: "warning|error|panicked" }, LOG.warnings),
    );
    this.#search = h("input", { type: "search", placeholder: LOG.search, "aria-label": LOG.searchLog, input: () => this.#draw() });
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
      this.#output,
    );
    // A resumed job writes more.
    this.#unsubscribe = feed.listen({
      jobs: (changed) => changed.has(job.id) && this.#isComplete && !this.#isEnded() && void this.#fetch(),
    });
    void this.#fetch();
  }

  close(): void {
    this.#isClosed = true;
    this.#unsubscribe();
    clearTimeout(this.#timer);
  }

  // A deleted job counts as ended.
  #isEnded(): boolean {
    const job = this.#feed.jobs.get(this.#id);
    return !job || ENDED.includes(job.status);
  }

  async #fetch(): Promise<void> {
    this.#isComplete = false;
    // Read before the request: the response lacks output written after it was sent.
    const wasEnded = this.#isEnded();
    let isAnswered = true;
    // The range starts at the last known byte, so that it is never empty.
    const range = this.#nextByte > 0 ? `bytes=${this.#nextByte - 1}-` : `bytes=-${INITIAL_BYTES}`;
    try {
      const response = await request(`jobs/${this.#id}/logs`, "GET", undefined, { headers: { Range: range } });
      const bytes = new Uint8Array(await response.arrayBuffer());
      const first = Number(/bytes (\d+)-/.exec(response.headers.get("content-range") ?? "")?.[1] ?? 0);
      // A full response replaces the known text.
      const known = response.status === 206 && this.#nextByte > 0 ? this.#nextByte - first : 0;
      if (known === 0) [this.#lines, this.#decoder] = [[""], new TextDecoder()];
      this.#nextByte = first + bytes.byteLength;
      // The last character may be incomplete.
      this.#append(this.#decoder.decode(bytes.subarray(known), { stream: true }));
    } catch (error) {
      // Without a response, poll again.
      isAnswered = error instanceof ApiError && error.problem.status > 0;
    }
    this.#isComplete = wasEnded && isAnswered && this.#isEnded();
    if (!this.#isComplete && !this.#isClosed) this.#timer = window.setTimeout(() => void this.#fetch(), POLL_INTERVAL_MS);
  }

  #append(text: string): void {
    const [first = "", ...rest] = text.split("\n");
    this.#lines[this.#lines.length - 1] += first;
    this.#lines.push(...rest);
    this.#lines.splice(0, Math.max(0, this.#lines.length - MAX_LINES));
    this.#draw();
  }

  #draw(): void {
    const level = new RegExp(this.#level.value, "i");
    const query = this.#search.value.toLowerCase();
    const filtered = this.#lines.filter((line) => level.test(line) && line.toLowerCase().includes(query));
    const [before, text] = [this.#output.textContent ?? "", filtered.join("\n").trimEnd() || LOG.none];
    // Append new text only: this keeps the selection, and screen readers read only the new lines.
    const isExtended = before !== "" && before !== LOG.none && text.startsWith(before);
    if (isExtended && text !== before) this.#output.append(text.slice(before.length));
    else if (!isExtended) this.#output.textContent = text;
    if (this.#follow.checked) this.#output.scrollTop = this.#output.scrollHeight;
  }
}
