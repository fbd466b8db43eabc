// Run of the whole pipeline at toy size: dataset, encoder, policy, evaluation. Each job starts when the previous one
// has succeeded. The run continues after a reload of the page in the same tab.

import { ApiError, requestJson } from "../common/api";
import { button, h } from "../common/dom";
import type { JobFeed } from "./job_feed";
import { PIPELINE } from "./strings";
import type { Job } from "./types";

const STORAGE_KEY = "ngf-pipeline";
const OBJECT = "sugar_box";
const ATTEMPTS = 4;

interface Run {
  // Prefix of the idempotency keys: a request that is repeated after a lost response creates one job.
  key: string;
  // Last job that was started; null before the first.
  job: string | null;
  step: number;
  dataset: string;
  encoder: string;
}

interface JobRequest {
  kind: string;
  params: Record<string, unknown>;
}

// Requests in order, with the outputs of the jobs before.
const STEPS: ((run: Run, previous: Job | null) => JobRequest)[] = [
  () => ({ kind: "dataset.generate", params: { preset: "smoke" } }),
  ({ dataset }) => ({ kind: "encoder.train", params: { preset: "smoke", dataset_id: dataset } }),
  ({ dataset, encoder }) => ({ kind: "policy.train", params: { preset: "smoke", dataset_id: dataset, encoder_id: encoder } }),
  (_, policy) => ({ kind: "policy.evaluate", params: { model_id: policy?.outputs.model_id, object: OBJECT, attempts: ATTEMPTS } }),
];

export class PipelineRun {
  readonly #feed: JobFeed;
  readonly #onRejected: (error: ApiError) => void;
  #run: Run | null = restore();
  #isRequesting = false;

  // `onRejected` is called when the server rejects a job, which ends the run.
  constructor(feed: JobFeed, onRejected: (error: ApiError) => void) {
    [this.#feed, this.#onRejected] = [feed, onRejected];
    feed.listen({
      jobs: (changed) => {
        if (this.#run?.job && changed.has(this.#run.job)) void this.#advance();
      },
      connection: (state) => state === "live" && void this.#resume(),
    });
  }

  // Button that starts a run, with a description.
  panel(): HTMLElement {
    const start = button(PIPELINE.start, () => this.#start(), { class: "pipeline-start" });
    return h("section", { class: "pipeline" }, h("p", { class: "hint" }, PIPELINE.description), start);
  }

  async #start(): Promise<void> {
    this.#run = { key: randomKey(), job: null, step: 0, dataset: "", encoder: "" };
    await this.#request(null);
  }

  // After a reload or a lost connection: the job may have ended meanwhile.
  async #resume(): Promise<void> {
    if (!this.#run?.job) return;
    try {
      await this.#feed.fetch(this.#run.job);
    } catch {
      // The job was deleted, or the server is lost again.
      return;
    }
    await this.#advance();
  }

  // Starts the next job if the last one has succeeded; ends the run if it has failed.
  async #advance(): Promise<void> {
    const run = this.#run;
    const job = run?.job ? this.#feed.jobs.get(run.job) : undefined;
    if (!run || !job || this.#isRequesting) return;
    if (job.status === "failed" || job.status === "cancelled" || (job.status === "succeeded" && run.step + 1 >= STEPS.length)) {
      return this.#store(null);
    }
    if (job.status !== "succeeded") return;
    run.dataset ||= job.outputs.dataset_id ?? "";
    if (job.kind === "encoder.train") run.encoder = job.outputs.model_id ?? "";
    run.step += 1;
    try {
      await this.#request(job);
    } catch (error) {
      // A lost request is repeated after the reconnection.
      run.step -= 1;
      if (!(error instanceof ApiError) || error.problem.status === 0) return;
      this.#store(null);
      this.#onRejected(error);
    }
  }

  async #request(previous: Job | null): Promise<void> {
    const run = this.#run!;
    this.#isRequesting = true;
    try {
      const { kind, params } = STEPS[run.step]!(run, previous);
      const body = { kind, params, name: PIPELINE.job(run.step + 1, STEPS.length) };
      const job = await requestJson<Job>("jobs", "POST", body, { headers: { "Idempotency-Key": `${run.key}-${run.step}` } });
      // The view follows the run, unless the user looks at something else.
      const isFollowed = previous === null || location.hash === `#jobs/${previous.id}`;
      this.#store({ ...run, job: job.id });
      this.#feed.put(job);
      if (isFollowed) location.hash = `#jobs/${job.id}`;
    } finally {
      this.#isRequesting = false;
    }
  }

  #store(run: Run | null): void {
    this.#run = run;
    if (run) sessionStorage.setItem(STORAGE_KEY, JSON.stringify(run));
    else sessionStorage.removeItem(STORAGE_KEY);
  }
}

function restore(): Run | null {
  const text = sessionStorage.getItem(STORAGE_KEY);
  return text === null ? null : (JSON.parse(text) as Run);
}

// `randomUUID` is unavailable on pages served by plain HTTP.
export function randomKey(): string {
  return [...crypto.getRandomValues(new Uint32Array(4))].map((part) => part.toString(36)).join("-");
}
