// The jobs of the server, kept as they are there: pages of a list, one stream of what happens, and whatever else was
// asked for. Those are listed that a filter wants and that the pages so far have come to.

import { ask, type List, Refused } from "../common/api";
import { Stream } from "../common/stream";
import { ENDED, type Job, type JobEvent } from "./types";

const TYPES: JobEvent["type"][] = ["status", "progress", "metric", "log", "checkpoint", "artifact", "alert"];
const PAGE = 100;
// What changes faster is shown at most so often (ms).
const CALM = 250;
// An answer that was lost is asked for again after this (ms).
const AGAIN = 2000;

export type Connection = "connecting" | "live" | "lost";

// Statuses (with commas) and the kind of the jobs that are listed, "" being all.
export interface Filter {
  status: string;
  kind: string;
}

export interface Listener {
  jobs?(changed: Set<string>): void;
  event?(event: JobEvent): void;
  connection?(state: Connection): void;
}

export class Feed {
  readonly jobs = new Map<string, Job>();
  readonly #listeners = new Set<Listener>();
  #hasMore = true;
  #filter: Filter = { status: "", kind: "" };
  // The filter of which a page is being fetched.
  #coming: Filter | null = null;
  // The last id of the pages so far, "" before the first; jobs that are known from elsewhere may be older.
  #oldest = "";
  #changed = new Set<string>();
  #stale = new Set<string>();
  #timer = 0;
  #told = 0;

  // Hears from now on; gives what ends that.
  listen(listener: Listener): () => void {
    this.#listeners.add(listener);
    return () => this.#listeners.delete(listener);
  }

  get hasMore(): boolean {
    return this.#hasMore;
  }

  // Ids sort by time.
  isListed({ id, status, kind }: Job): boolean {
    const wanted = this.#filter;
    const isWanted = (!wanted.status || wanted.status.split(",").includes(status)) && (!wanted.kind || wanted.kind === kind);
    return isWanted && (!this.#hasMore || (this.#oldest !== "" && id >= this.#oldest));
  }

  // Lists these from now on; its pages begin anew.
  filter(filter: Filter): void {
    [this.#filter, this.#oldest, this.#hasMore] = [filter, "", true];
  }

  // Fetches the next page, one at a time.
  async more(): Promise<void> {
    const filter = this.#filter;
    if (!this.#hasMore || this.#coming === filter) return;
    this.#coming = filter;
    try {
      const page = await this.#page(this.#oldest);
      if (!page) return;
      this.#hasMore = page.has_more;
      this.#oldest = page.data.at(-1)?.id ?? this.#oldest;
      this.#tell();
    } finally {
      if (this.#coming === filter) this.#coming = null;
    }
  }

  // Takes those that a filter wants and that are older than this one; null if another filter was chosen meanwhile.
  async #page(after: string): Promise<List<Job> | null> {
    const filter = this.#filter;
    const asked = Object.entries({ limit: String(PAGE), after, ...filter }).filter(([, value]) => value !== "");
    const before = new Map(this.jobs);
    const page = await ask<List<Job>>(`jobs?${new URLSearchParams(asked)}`);
    if (filter !== this.#filter) return null;
    for (const job of page.data) this.#answer(job, before.get(job.id));
    return page;
  }

  // What was begun, ended or deleted while nobody listened: the first page as it is now.
  async #catchUp(): Promise<void> {
    if (this.#oldest === "") return;
    // A server that went away again comes back again.
    const page = await this.#page("").catch(() => null);
    if (!page) return;
    const [found, last] = [new Set(page.data.map(({ id }) => id)), page.data.at(-1)?.id ?? ""];
    const isMissing = (job: Job) => this.isListed(job) && !found.has(job.id) && (!page.has_more || job.id >= last);
    for (const job of this.jobs.values()) if (isMissing(job)) this.#stale.add(job.id);
    this.#tell();
  }

  // One job, as it is now.
  async fetch(id: string): Promise<Job> {
    const job = await this.#ask(id);
    this.#tell();
    return job;
  }

  async #ask(id: string): Promise<Job> {
    const before = this.jobs.get(id);
    const job = await ask<Job>(`jobs/${id}`);
    this.#answer(job, before);
    return job;
  }

  // Takes an answer, and asks once more if it was overtaken: what came meanwhile may be newer.
  #answer(job: Job, before: Job | undefined): void {
    if (this.jobs.get(job.id) !== before) this.#stale.add(job.id);
    this.#put(job);
  }

  forget(id: string): void {
    if (this.jobs.delete(id)) this.#changed.add(id);
    this.#tell();
  }

  // Takes a job that an answer brought.
  put(job: Job): void {
    this.#put(job);
    this.#tell();
  }

  // Listens to all jobs; goes on after the last event whenever the connection was lost.
  start(): void {
    new Stream<JobEvent>(TYPES, {
      goesOn: true,
      opened: () => this.#connected("live"),
      lost: () => this.#connected("lost"),
      received: (event) => this.#receive(event),
    });
  }

  #connected(state: Connection): void {
    for (const listener of this.#listeners) listener.connection?.(state);
    if (state !== "live") return;
    // What happened before the stream was open; what is over seldom has anything to tell.
    for (const { id, status } of this.jobs.values()) if (!ENDED.includes(status)) this.#refresh(id);
    void this.#catchUp();
  }

  #receive(event: JobEvent): void {
    for (const listener of this.#listeners) listener.event?.(event);
    const job = this.jobs.get(event.job);
    if (event.type === "progress" && job) {
      const { phase, progress } = event.data as { phase: string; progress: Job["progress"] };
      if (progress) {
        const left = Math.max(0, progress.total - progress.completed);
        progress.fraction = progress.total > 0 ? progress.completed / progress.total : 0;
        progress.eta_seconds = progress.rate_per_second ? left / progress.rate_per_second : null;
      }
      this.#put({ ...job, phase, progress });
      this.#tell();
    } else if (event.type === "metric" && job) {
      this.#put({ ...job, latest_metrics: { ...job.latest_metrics, ...event.data } });
      this.#tell();
    } else if (event.type !== "log") {
      this.#refresh(event.job);
    }
  }

  #refresh(id: string): void {
    this.#stale.add(id);
    this.#tell();
  }

  #put(job: Job): void {
    this.jobs.set(job.id, job);
    this.#changed.add(job.id);
  }

  #tell(): void {
    if (this.#timer) return;
    const passed = performance.now() - this.#told;
    this.#timer = window.setTimeout(() => {
      this.#timer = 0;
      this.#told = performance.now();
      void this.#update();
    }, Math.max(0, CALM - passed));
  }

  async #update(): Promise<void> {
    const stale = [...this.#stale];
    const lost: string[] = [];
    this.#stale.clear();
    await Promise.all(
      stale.map(async (id) => {
        try {
          await this.#ask(id);
        } catch (error) {
          const isGone = error instanceof Refused && error.problem.status === 404;
          if (isGone && this.jobs.delete(id)) this.#changed.add(id);
          // The event that made it stale may have been its last.
          if (!isGone) lost.push(id);
        }
      }),
    );
    if (lost.length > 0) setTimeout(() => lost.forEach((id) => this.#refresh(id)), AGAIN);
    const changed = this.#changed;
    this.#changed = new Set();
    for (const listener of this.#listeners) listener.jobs?.(changed);
    if (this.#stale.size > 0) this.#tell();
  }
}
