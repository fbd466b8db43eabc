// View of one job: status, actions, metrics, checkpoints, outputs, parameters and log.

import { API, ApiError, type List, requestJson } from "../common/api";
import { button, h } from "../common/dom";
import { caughtErrorCard, download, errorCard, factList, link, section } from "../common/components";
import { dateTime, duration, number } from "../common/numbers";
import { Alerts } from "./alerts";
import { Charts } from "./charts";
import { Checkpoints } from "./checkpoints";
import { demoLink, progressText, showStatus } from "./components";
import { evaluationTable } from "./evaluations";
import type { JobFeed } from "./job_feed";
import { Log, lastLines } from "./log";
import type { View } from "./main_view";
import { KINDS } from "./kinds";
import { DEMO, EVALUATION, FACTS, JOB, LOG, PROGRESS } from "./strings";
import { type Artifact, type Checkpoint, ENDED, type Evaluation, type Job, title } from "./types";
import { UndoableDelete } from "./undoable_delete";

export class JobDetail implements View {
  readonly element = h("article", { class: "job-detail" });
  readonly #feed: JobFeed;
  readonly #id: string;
  readonly #name = h("h1");
  readonly #chip = h("span");
  readonly #buttons = h("span", { class: "actions" });
  readonly #bar = h("progress", { max: 1, "aria-label": PROGRESS.title });
  readonly #status = h("p");
  readonly #jobError = h("div");
  readonly #outputs = h("div", { class: "outputs" });
  readonly #actionError = h("div");
  readonly #deletion = new UndoableDelete(() => this.#delete());
  readonly #unsubscribe: () => void;
  #charts: Charts | null = null;
  #alerts: Alerts | null = null;
  #checkpoints: Checkpoints | null = null;
  #log: Log | null = null;
  #shownStatus = "";
  // An action was started whose button disappears with the next status; focus then moves to the first new button.
  #hasActed = false;
  // The last request for the job, or for its outputs, failed.
  #hasFailed = false;
  #haveOutputsFailed = false;
  // Only the latest request for outputs is shown.
  #numRequests = 0;
  #isClosed = false;

  constructor(feed: JobFeed, id: string) {
    this.#feed = feed;
    this.#id = id;
    this.#unsubscribe = feed.listen({
      jobs: (changed) => changed.has(id) && this.#show(),
      event: (event) => {
        if (event.job !== id) return;
        if (event.type === "checkpoint") this.#checkpoints?.add(event.data as unknown as Checkpoint);
        if (event.type === "alert") this.#alerts?.add(event);
      },
      connection: (state) => state === "live" && this.#catchUp(),
    });
    void this.#open();
  }

  close(): void {
    this.#isClosed = true;
    this.#unsubscribe();
    this.#charts?.close();
    this.#log?.close();
    // The undo button is no longer visible.
    this.#deletion.commit();
  }

  // Repeats failed requests after a reconnection.
  #catchUp(): void {
    if (this.#charts) {
      void this.#alerts?.fetch();
      void this.#checkpoints?.fetch();
      if (this.#haveOutputsFailed) void this.#showOutputs();
    } else if (this.#hasFailed) {
      void this.#open();
    }
  }

  async #open(): Promise<void> {
    this.#hasFailed = false;
    try {
      const known = this.#feed.jobs.get(this.#id);
      if (known) void this.#refresh();
      const job = known ?? (await this.#feed.fetch(this.#id));
      if (this.#isClosed) return;
      this.element.replaceChildren();
      this.#charts = new Charts(this.#feed, [job]);
      this.#alerts = new Alerts(job.id);
      this.#checkpoints = new Checkpoints(job.id);
      this.#log = new Log(this.#feed, job);
      const head = h(
        "header",
        {},
        h("div", { class: "title" }, this.#name, this.#chip, this.#buttons),
        h("p", { class: "hint" }, `${KINDS[job.kind] ?? job.kind} · ${job.id}`),
        this.#bar,
        this.#status,
        this.#alerts.element,
        this.#jobError,
        this.#deletion.element,
        this.#actionError,
      );
      this.element.append(head, this.#charts.element, this.#checkpoints.element, this.#outputs, this.#log.element);
      this.#show();
    } catch (error) {
      this.#hasFailed = true;
      this.element.replaceChildren(caughtErrorCard(error));
    }
  }

  // Fetches a known job again: deletions by other clients are not in the event stream.
  async #refresh(): Promise<void> {
    try {
      await this.#feed.fetch(this.#id);
    } catch (error) {
      if (!(error instanceof ApiError) || error.problem.status !== 404) return;
      this.#feed.remove(this.#id);
      this.element.replaceChildren(caughtErrorCard(error));
    }
  }

  // Updates in place: an element that is replaced under the pointer cannot be clicked.
  #show(): void {
    const job = this.#feed.jobs.get(this.#id);
    if (!job) return;
    this.#name.textContent = title(job);
    showStatus(this.#chip, job.status);
    this.#status.textContent = statusText(job);
    this.#bar.hidden = !["running", "paused", "cancelling"].includes(job.status);
    if (job.progress) this.#bar.value = job.progress.fraction;
    if (this.#shownStatus === job.status) return;
    this.#shownStatus = job.status;
    this.#buttons.replaceChildren(...this.#actions(job));
    const isFocusLost = document.activeElement === null || document.activeElement === document.body;
    if (this.#hasActed && isFocusLost) this.#buttons.querySelector("button")?.focus();
    this.#hasActed = false;
    this.#jobError.replaceChildren(...(job.error ? [jobErrorCard(job.id, job.error)] : []));
    void this.#showOutputs();
  }

  #actions(job: Job): HTMLElement[] {
    const action = (name: string, label: string) =>
      button(label, () => {
        this.#hasActed = true;
        return this.#run(async () => this.#feed.put(await requestJson<Job>(`jobs/${job.id}/${name}`, "POST")));
      });
    const has = (...statuses: string[]) => statuses.includes(job.status);
    return [
      ...(has("running", "queued") ? [action("pause", JOB.pause)] : []),
      ...(has("paused") ? [action("resume", JOB.resume)] : []),
      ...(has("failed", "cancelled") ? [action("retry", job.resumable ? JOB.resume : JOB.retry)] : []),
      ...(has("running", "queued", "paused") ? [action("cancel", JOB.cancel)] : []),
      h("a", { class: "action", href: `#new?clone=${job.id}`, click: () => this.#deletion.cancel() }, JOB.duplicate),
      button(JOB.rename, () => this.#rename()),
      ...(ENDED.includes(job.status) ? [button(JOB.delete, () => this.#deletion.start())] : []),
    ];
  }

  // Runs an action, which cancels a pending deletion, and shows its error.
  async #run(act: () => Promise<unknown>): Promise<void> {
    this.#deletion.cancel();
    this.#actionError.replaceChildren();
    try {
      await act();
    } catch (error) {
      this.#actionError.replaceChildren(caughtErrorCard(error));
    }
  }

  async #rename(): Promise<void> {
    const name = prompt(JOB.newName, this.#feed.jobs.get(this.#id)?.name ?? "");
    if (name !== null) {
      await this.#run(async () => this.#feed.put(await requestJson<Job>(`jobs/${this.#id}`, "PATCH", { name: name || null })));
    }
  }

  async #delete(): Promise<void> {
    try {
      await requestJson(`jobs/${this.#id}`, "DELETE");
      this.#feed.remove(this.#id);
      if (!this.#isClosed) location.hash = "#jobs";
    } catch (error) {
      // After a change of view, the job is still in the list.
      this.#actionError.replaceChildren(caughtErrorCard(error));
    }
  }

  async #showOutputs(): Promise<void> {
    const request = ++this.#numRequests;
    const id = this.#id;
    const job = this.#feed.jobs.get(id);
    if (!job || this.#isClosed) return;
    let artifacts: Artifact[] = [];
    let reports: Evaluation[] = [];
    let errorElement: HTMLElement | null = null;
    try {
      artifacts = (await requestJson<List<Artifact>>(`jobs/${id}/artifacts`)).data;
      const report = job.kind === "policy.evaluate" && artifacts.find(({ name }) => name === "report.json");
      if (report) reports = await requestJson<Evaluation[]>(`artifacts/${report.hash}`);
    } catch (error) {
      errorElement = caughtErrorCard(error);
    }
    if (request !== this.#numRequests) return;
    this.#haveOutputsFailed = errorElement !== null;
    this.#outputs.replaceChildren(
      ...(reports.length > 0 ? [section(EVALUATION.title, evaluationTable(reports, job))] : []),
      section(JOB.outputs, outputLinks(job), fileList(artifacts), errorElement),
      section(JOB.parameters, factList(parameters(job))),
    );
  }
}

function statusText(job: Job): string {
  if (job.status === "queued") return job.attempt > 0 ? JOB.queuedToResume : JOB.queued;
  if (job.status === "cancelling") return JOB.cancelling;
  if (ENDED.includes(job.status) && job.started_at && job.finished_at) {
    const seconds = (Date.parse(job.finished_at) - Date.parse(job.started_at)) / 1000;
    return `${dateTime(job.started_at)}, ${duration(seconds)}${job.attempt > 1 ? JOB.starts(job.attempt) : ""}`;
  }
  return progressText(job);
}

// Card of a failed job with the end of its log.
function jobErrorCard(id: string, { message, hint, code, param }: NonNullable<Job["error"]>): HTMLElement {
  const card = errorCard(message, hint ?? "", [code, param].filter(Boolean).join(" "));
  void lastLines(id).then((lines) => lines && card.append(h("pre", { class: "log-end", tabindex: 0, "aria-label": LOG.lastLines }, lines)));
  return card;
}

function outputLinks(job: Job): HTMLElement | string {
  const { dataset_id, model_id } = job.outputs;
  const pairs: [string, Node | string][] = [];
  if (dataset_id) pairs.push([FACTS.dataset, link(`datasets/${dataset_id}`, dataset_id)]);
  if (model_id) pairs.push([FACTS.model, link(`models/${model_id}`, model_id)]);
  if (model_id && job.kind === "policy.train") pairs.push([FACTS.demo, demoLink(`model=${model_id}`, DEMO.tryIt)]);
  const next = nextStep(job);
  if (next) pairs.push([FACTS.next, next]);
  if (pairs.length > 0) return factList(pairs);
  return ENDED.includes(job.status) ? "" : JOB.noOutputs;
}

// Form of the job that uses the outputs of this one.
function nextStep({ kind, params, outputs: { dataset_id, model_id } }: Job): HTMLElement | null {
  const form = (kind: string, values: Record<string, string>) =>
    link(`new?${new URLSearchParams({ kind, ...values })}`, KINDS[kind] ?? kind);
  // The policy to which a dataset is adapted has an encoder for it.
  if (dataset_id && kind === "dataset.adapt") return form("policy.train", { dataset_id, encoder_id: String(params["model_id"]) });
  if (dataset_id) return form("encoder.train", { dataset_id });
  if (!model_id) return null;
  if (kind === "policy.train") return form("policy.evaluate", { model_id });
  return form("policy.train", { dataset_id: String(params["dataset_id"]), encoder_id: model_id });
}

function fileList(artifacts: Artifact[]): HTMLElement | null {
  if (artifacts.length === 0) return null;
  const item = ({ hash, name, bytes }: Artifact) => h("li", {}, download(new URL(`artifacts/${hash}`, API).href, name, bytes));
  return h("ul", { class: "files" }, ...artifacts.map(item));
}

// Parameters that are set, with links to input records, and the worker.
function parameters(job: Job): [string, Node | string][] {
  const cell = (name: string, value: unknown): Node | string => {
    if (name === "dataset_id") return link(`datasets/${String(value)}`, String(value));
    if (name === "encoder_id" || name === "model_id") return link(`models/${String(value)}`, String(value));
    return typeof value === "number" ? number(value) : String(value);
  };
  const set = Object.entries(job.params).filter(([, value]) => value !== null);
  const worker: [string, string][] = job.worker ? [[JOB.worker, JOB.workerVersion(job.worker.host, job.worker.version)]] : [];
  return [...set.map(([name, value]): [string, Node | string] => [name, cell(name, value)]), ...worker];
}
