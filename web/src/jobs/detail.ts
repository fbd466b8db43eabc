// One job: where it stands, what can be done about it, what it measured, said and made.

import { API, ask, type List, Refused } from "../common/api";
import { button, h } from "../common/dom";
import { download, facts, failureCard, link, refusal, section } from "../common/parts";
import { duration, number, when } from "../common/numbers";
import { Alerts } from "./alerts";
import { Charts } from "./charts";
import { Checkpoints } from "./checkpoints";
import { Deletion } from "./deletion";
import { evaluations } from "./evaluations";
import type { Feed } from "./feed";
import { Log, lastLines } from "./log";
import { demo, progressInWords, showStatus } from "./parts";
import { DEMO, EVALUATION, FACTS, JOB, KINDS, LOG, PROGRESS } from "./strings";
import { type Artifact, type Checkpoint, ENDED, type Evaluation, type Job, title } from "./types";
import type { View } from "./view";

export class Detail implements View {
  readonly element = h("article", { class: "detail-job" });
  readonly #feed: Feed;
  readonly #id: string;
  readonly #name = h("h1");
  readonly #chip = h("span");
  readonly #buttons = h("span", { class: "actions" });
  readonly #bar = h("progress", { max: 1, "aria-label": PROGRESS.title });
  readonly #stands = h("p");
  readonly #error = h("div");
  readonly #made = h("div", { class: "made" });
  readonly #notice = h("div");
  readonly #deletion = new Deletion(() => this.#delete());
  readonly #stop: () => void;
  #charts: Charts | null = null;
  #alerts: Alerts | null = null;
  #checkpoints: Checkpoints | null = null;
  #log: Log | null = null;
  #seen = "";
  // Whether a button was pressed that its job's next status takes away: whoever pressed it goes on from the next one.
  #hasActed = false;
  // The job, or what came of it, could not be had.
  #isRefused = false;
  #isMadeRefused = false;
  // How often what came of it was asked for: an answer may be overtaken.
  #asked = 0;
  #isClosed = false;

  constructor(feed: Feed, id: string) {
    this.#feed = feed;
    this.#id = id;
    this.#stop = feed.listen({
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
    this.#stop();
    this.#charts?.close();
    this.#log?.close();
    // It cannot be taken back where it is not seen.
    this.#deletion.settle();
  }

  // The server is back: what could not be had is asked for again.
  #catchUp(): void {
    if (this.#charts) {
      void this.#alerts?.fetch();
      void this.#checkpoints?.fetch();
      if (this.#isMadeRefused) void this.#showMade();
    } else if (this.#isRefused) {
      void this.#open();
    }
  }

  async #open(): Promise<void> {
    this.#isRefused = false;
    try {
      const known = this.#feed.jobs.get(this.#id);
      if (known) void this.#fetchAgain();
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
        this.#stands,
        this.#alerts.element,
        this.#error,
        this.#deletion.element,
        this.#notice,
      );
      this.element.append(head, this.#charts.element, this.#checkpoints.element, this.#made, this.#log.element);
      this.#show();
    } catch (error) {
      this.#isRefused = true;
      this.element.replaceChildren(refusal(error));
    }
  }

  // It may have been deleted elsewhere, of which nobody is told.
  async #fetchAgain(): Promise<void> {
    try {
      await this.#feed.fetch(this.#id);
    } catch (error) {
      if (!(error instanceof Refused) || error.problem.status !== 404) return;
      this.#feed.forget(this.#id);
      this.element.replaceChildren(refusal(error));
    }
  }

  // Changes in place: what is replaced under the pointer cannot be clicked.
  #show(): void {
    const job = this.#feed.jobs.get(this.#id);
    if (!job) return;
    this.#name.textContent = title(job);
    showStatus(this.#chip, job.status);
    this.#stands.textContent = stands(job);
    this.#bar.hidden = !["running", "paused", "cancelling"].includes(job.status);
    if (job.progress) this.#bar.value = job.progress.fraction;
    if (this.#seen === job.status) return;
    this.#seen = job.status;
    this.#buttons.replaceChildren(...this.#actions(job));
    const isLost = document.activeElement === null || document.activeElement === document.body;
    if (this.#hasActed && isLost) this.#buttons.querySelector("button")?.focus();
    this.#hasActed = false;
    this.#error.replaceChildren(...(job.error ? [failed(job.id, job.error)] : []));
    void this.#showMade();
  }

  #actions(job: Job): HTMLElement[] {
    const verb = (name: string, label: string) =>
      button(label, () => {
        this.#hasActed = true;
        return this.#do(async () => this.#feed.put(await ask<Job>(`jobs/${job.id}/${name}`, "POST")));
      });
    const has = (...statuses: string[]) => statuses.includes(job.status);
    return [
      ...(has("running", "queued") ? [verb("pause", JOB.pause)] : []),
      ...(has("paused") ? [verb("resume", JOB.resume)] : []),
      ...(has("failed", "cancelled") ? [verb("retry", job.resumable ? JOB.goOn : JOB.tryAgain)] : []),
      ...(has("running", "queued", "paused") ? [verb("cancel", JOB.stop)] : []),
      h("a", { class: "action", href: `#new?clone=${job.id}`, click: () => this.#deletion.cancel() }, JOB.again),
      button(JOB.rename, () => this.#rename()),
      ...(ENDED.includes(job.status) ? [button(JOB.delete, () => this.#deletion.begin())] : []),
    ];
  }

  // Whoever wants something else of a job does not want it deleted.
  async #do(act: () => Promise<unknown>): Promise<void> {
    this.#deletion.cancel();
    this.#notice.replaceChildren();
    try {
      await act();
    } catch (error) {
      this.#notice.replaceChildren(refusal(error));
    }
  }

  async #rename(): Promise<void> {
    const name = prompt(JOB.nameOf, this.#feed.jobs.get(this.#id)?.name ?? "");
    if (name !== null) {
      await this.#do(async () => this.#feed.put(await ask<Job>(`jobs/${this.#id}`, "PATCH", { name: name || null })));
    }
  }

  async #delete(): Promise<void> {
    try {
      await ask(`jobs/${this.#id}`, "DELETE");
      this.#feed.forget(this.#id);
      if (!this.#isClosed) location.hash = "#jobs";
    } catch (error) {
      // Who has gone on sees it in the list as before.
      this.#notice.replaceChildren(refusal(error));
    }
  }

  async #showMade(): Promise<void> {
    const asked = ++this.#asked;
    const id = this.#id;
    const job = this.#feed.jobs.get(id);
    if (!job || this.#isClosed) return;
    let artifacts: Artifact[] = [];
    let reports: Evaluation[] = [];
    let why: HTMLElement | null = null;
    try {
      artifacts = (await ask<List<Artifact>>(`jobs/${id}/artifacts`)).data;
      const report = job.kind === "policy.evaluate" && artifacts.find(({ name }) => name === "report.json");
      if (report) reports = await ask<Evaluation[]>(`artifacts/${report.hash}`);
    } catch (error) {
      why = refusal(error);
    }
    if (asked !== this.#asked) return;
    this.#isMadeRefused = why !== null;
    this.#made.replaceChildren(
      ...(reports.length > 0 ? [section(EVALUATION.title, evaluations(reports, job))] : []),
      section(JOB.made, outputs(job), files(artifacts), why),
      section(JOB.told, facts(parameters(job))),
    );
  }
}

function stands(job: Job): string {
  if (job.status === "queued") return job.attempt > 0 ? JOB.waitsAgain : JOB.waits;
  if (job.status === "cancelling") return JOB.stopping;
  if (ENDED.includes(job.status) && job.started_at && job.finished_at) {
    const took = (Date.parse(job.finished_at) - Date.parse(job.started_at)) / 1000;
    return `${when(job.started_at)}, ${duration(took)}${job.attempt > 1 ? JOB.begun(job.attempt) : ""}`;
  }
  return progressInWords(job);
}

// Why it failed, what to do about it, and what its process said last.
function failed(id: string, { message, hint, code, param }: NonNullable<Job["error"]>): HTMLElement {
  const card = failureCard(message, hint ?? "", [code, param].filter(Boolean).join(" "));
  void lastLines(id).then((lines) => lines && card.append(h("pre", { class: "log-end", tabindex: 0, "aria-label": LOG.end }, lines)));
  return card;
}

function outputs(job: Job): HTMLElement | string {
  const { dataset_id, model_id } = job.outputs;
  const pairs: [string, Node | string][] = [];
  if (dataset_id) pairs.push([FACTS.dataset, link(`datasets/${dataset_id}`, dataset_id)]);
  if (model_id) pairs.push([FACTS.model, link(`models/${model_id}`, model_id)]);
  if (model_id && job.kind === "policy.train") pairs.push([FACTS.demo, demo(`model=${model_id}`, DEMO.tryIt)]);
  if (pairs.length > 0) return facts(pairs);
  return ENDED.includes(job.status) ? "" : JOB.madeNothing;
}

function files(artifacts: Artifact[]): HTMLElement | null {
  if (artifacts.length === 0) return null;
  const item = ({ hash, name, bytes }: Artifact) => h("li", {}, download(new URL(`artifacts/${hash}`, API).href, name, bytes));
  return h("ul", { class: "files" }, ...artifacts.map(item));
}

// What was set, with inputs as links to where they are.
function parameters(job: Job): [string, Node | string][] {
  const value = (name: string, set: unknown): Node | string => {
    if (name === "dataset_id") return link(`datasets/${String(set)}`, String(set));
    if (name === "encoder_id" || name === "model_id") return link(`models/${String(set)}`, String(set));
    return typeof set === "number" ? number(set) : String(set);
  };
  const set = Object.entries(job.params).filter(([, given]) => given !== null);
  const worker: [string, string][] = job.worker ? [[JOB.worker, JOB.workerOf(job.worker.host, job.worker.version)]] : [];
  return [...set.map(([name, given]): [string, Node | string] => [name, value(name, given)]), ...worker];
}
