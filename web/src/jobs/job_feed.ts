// Client-side copy of the server's jobs, updated from list pages, one event stream and single requests. The list shows
// the jobs that match the filter and that the loaded pages cover.

import { ApiError, type List, requestJson } from "../common/api";
import { EventStream } from "../common/event_stream";
import { ENDED, type Job, type JobEvent, type Progress } from "./types";

const TYPES: JobEvent["type"][] = ["status", "progress", "metric", "log", "checkpoint", "artifact", "alert"];
const PAGE_SIZE = 100;
// Minimum time between notifications of listeners.
const NOTIFY_INTERVAL_MS = 250;
// Delay before a failed request is repeated.
const RETRY_DELAY_MS = 2000;

export type Connection = "connecting" | "live" | "lost";

// Filter of the list: comma-separated statuses and a kind; "" matches all.
export interface Filter {
  status: string;
  kind: string;
}

export interface Listener {
  jobs?(changed: Set<string>): void;
  event?(event: JobEvent): void;
  connection?(state: Connection): void;
}

export class JobFeed {
  readonly jobs = new Map<string, Job>();
  readonly #listeners = new Set<Listener>();
  #hasMore = true;
  #filter: Filter = { status: "", kind: "" };
  // Filter of the page request in progress.
  #loading: Filter | null = null;
  // Last id of the loaded pages; "" before the first page. Jobs known from other requests may be older.
  #oldest = "";
  #changed = new Set<string>();
  #stale = new Set<string>();
  #timer = 0;
  #lastNotified = 0;

  // Subscribes a listener. Returns the function that unsubscribes it.
  listen(listener: Listener): () => void {
    this.#listeners.add(listener);
    return () => this.#listeners.delete(listener);
  }

  get hasMore(): boolean {
    return this.#hasMore;
  }

  // Whether the list shows the job. Ids sort by time.
  isListed({ id, status, kind }: Job): boolean {
    const filter = this.#filter;
    const isMatch = (!filter.status || filter.status.split(",").includes(status)) && (!filter.kind || filter.kind === kind);
    return isMatch && (!this.#hasMore || (this.#oldest !== "" && id >= this.#oldest));
  }

  // Changes the filter and restarts at the first page.
  filter(filter: Filter): void {
    [this.#filter, this.#oldest, this.#hasMore] = [filter, "", true];
  }

  // Loads the next page, one at a time.
  async loadMore(): Promise<void> {
    const filter = this.#filter;
    if (!this.#hasMore || this.#loading === filter) return;
    this.#loading = filter;
    try {
      const page = await this.#fetchPage(this.#oldest);
      if (!page) return;
      this.#hasMore = page.has_more;
      this.#oldest = page.data.at(-1)?.id ?? this.#oldest;
      this.#scheduleUpdate();
    } finally {
      if (this.#loading === filter) this.#loading = null;
    }
  }

  // Fetches the filtered jobs older than `after`. Returns null if the filter changed meanwhile.
  async #fetchPage(after: string): Promise<List<Job> | null> {
    const filter = this.#filter;
    const query = Object.entries({ limit: String(PAGE_SIZE), after, ...filter }).filter(([, value]) => value !== "");
    const before = new Map(this.jobs);
    const page = await requestJson<List<Job>>(`jobs?${new URLSearchParams(query)}`);
    if (filter !== this.#filter) return null;
    for (const job of page.data) this.#store(job, before.get(job.id));
    return page;
  }

  // After a lost connection: reloads the first page to find jobs that were created, ended or deleted meanwhile.
  async #catchUp(): Promise<void> {
    if (this.#oldest === "") return;
    // On failure, the next reconnection calls this again.
    const page = await this.#fetchPage("").catch(() => null);
    if (!page) return;
    const [found, last] = [new Set(page.data.map(({ id }) => id)), page.data.at(-1)?.id ?? ""];
    const isMissing = (job: Job) => this.isListed(job) && !found.has(job.id) && (!page.has_more || job.id >= last);
    for (const job of this.jobs.values()) if (isMissing(job)) this.#stale.add(job.id);
    this.#scheduleUpdate();
  }

  // Fetches the current state of one job.
  async fetch(id: string): Promise<Job> {
    const job = await this.#fetchJob(id);
    this.#scheduleUpdate();
    return job;
  }

  async #fetchJob(id: string): Promise<Job> {
    const before = this.jobs.get(id);
    const job = await requestJson<Job>(`jobs/${id}`);
    this.#store(job, before);
    return job;
  }

  // Stores a response. If the job changed during the request, the response may be outdated and is fetched again.
  #store(job: Job, before: Job | undefined): void {
    if (this.jobs.get(job.id) !== before) this.#stale.add(job.id);
    this.#put(job);
  }

  remove(id: string): void {
    if (this.jobs.delete(id)) this.#changed.add(id);
    this.#scheduleUpdate();
  }

  // Stores the job of a write request's response.
  put(job: Job): void {
    this.#put(job);
    this.#scheduleUpdate();
  }

  // Subscribes to all jobs. After a lost connection, the stream resumes after the last event.
  start(): void {
    new EventStream<JobEvent>(TYPES, {
      resumes: true,
      onOpen: () => this.#setConnection("live"),
      onLost: () => this.#setConnection("lost"),
      onEvent: (event) => this.#receive(event),
    });
  }

  #setConnection(state: Connection): void {
    for (const listener of this.#listeners) listener.connection?.(state);
    if (state !== "live") return;
    // Active jobs may have changed before the stream opened; ended jobs rarely do.
    for (const { id, status } of this.jobs.values()) if (!ENDED.includes(status)) this.#refresh(id);
    void this.#catchUp();
  }

  #receive(event: JobEvent): void {
    for (const listener of this.#listeners) listener.event?.(event);
    const job = this.jobs.get(event.job);
    if (event.type === "progress" && job) {
      const { phase, progress } = event.data as { phase: string; progress: Progress | null };
      if (progress) {
        const left = Math.max(0, progress.total - progress.completed);
        progress.fraction = progress.total > 0 ? progress.completed / progress.total : 0;
        progress.eta_seconds = progress.rate_per_second ? left / progress.rate_per_second : null;
      }
      this.#put({ ...job, phase, progress });
      this.#scheduleUpdate();
    } else if (event.type === "metric" && job) {
      this.#put({ ...job, latest_metrics: { ...job.latest_metrics, ...event.data } });
      this.#scheduleUpdate();
    } else if (event.type !== "log") {
      this.#refresh(event.job);
    }
  }

  #refresh(id: string): void {
    this.#stale.add(id);
    this.#scheduleUpdate();
  }

  #put(job: Job): void {
    this.jobs.set(job.id, job);
    this.#changed.add(job.id);
  }

  #scheduleUpdate(): void {
    if (this.#timer) return;
    const elapsed = performance.now() - this.#lastNotified;
    this.#timer = window.setTimeout(() => {
      this.#timer = 0;
      this.#lastNotified = performance.now();
      void this.#update();
    }, Math.max(0, NOTIFY_INTERVAL_MS - elapsed));
  }

  async #update(): Promise<void> {
    const stale = [...this.#stale];
    const failed: string[] = [];
    this.#stale.clear();
    await Promise.all(
      stale.map(async (id) => {
        try {
          await this.#fetchJob(id);
        } catch (error) {
          const isGone = error instanceof ApiError && error.problem.status === 404;
          if (isGone && this.jobs.delete(id)) this.#changed.add(id);
          // The event that made the job stale may have been its last.
          if (!isGone) failed.push(id);
        }
      }),
    );
    if (failed.length > 0) setTimeout(() => failed.forEach((id) => this.#refresh(id)), RETRY_DELAY_MS);
    const changed = this.#changed;
    this.#changed = new Set();
    for (const listener of this.#listeners) listener.jobs?.(changed);
    if (this.#stale.size > 0) this.#scheduleUpdate();
  }
}
