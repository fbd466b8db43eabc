// One job: where it stands, what can be done about it, what it measured, said and made.

import { API, ask, type List } from "../common/api";
import { button, h } from "../common/dom";
import { download, facts, failureCard, link, refusal, section } from "../common/parts";
import { duration, number, when } from "../common/words";
import { Charts } from "./charts";
import { Checkpoints } from "./checkpoints";
import type { Feed } from "./feed";
import { Log } from "./log";
import { demo, evaluations, progressInWords } from "./parts";
import { type Artifact, type Checkpoint, ENDED, type Evaluation, type Job, KINDS, title } from "./types";
import type { View } from "./view";

// A deletion can be taken back for so long (ms).
const REGRET = 6000;

export class Detail implements View {
  readonly element = h("article", { class: "detail-job" });
  readonly #feed: Feed;
  readonly #id: string;
  readonly #name = h("h1");
  readonly #chip = h("span");
  readonly #buttons = h("span", { class: "actions" });
  readonly #bar = h("progress", { max: 1, "aria-label": "Progress" });
  readonly #stands = h("p");
  readonly #error = h("div");
  readonly #made = h("div", { class: "made" });
  readonly #notice = h("div");
  readonly #stop: () => void;
  #charts: Charts | null = null;
  #checkpoints: Checkpoints | null = null;
  #log: Log | null = null;
  #seen = "";
  #isClosed = false;

  constructor(feed: Feed, id: string) {
    this.#feed = feed;
    this.#id = id;
    this.#stop = feed.listen({
      jobs: (changed) => changed.has(id) && this.#show(),
      event: ({ job, type, data }) => {
        if (job === id && type === "checkpoint") this.#checkpoints?.add(data as unknown as Checkpoint);
      },
    });
    void this.#open();
  }

  close(): void {
    this.#isClosed = true;
    this.#stop();
    this.#charts?.close();
    this.#log?.close();
  }

  async #open(): Promise<void> {
    try {
      const job = this.#feed.jobs.get(this.#id) ?? (await this.#feed.fetch(this.#id));
      if (this.#isClosed) return;
      this.#charts = new Charts(this.#feed, [job]);
      this.#checkpoints = new Checkpoints(job.id);
      this.#log = new Log(this.#feed, job);
      const head = h(
        "header",
        {},
        h("div", { class: "title" }, this.#name, this.#chip, this.#buttons),
        h("p", { class: "hint" }, `${KINDS[job.kind] ?? job.kind} · ${job.id}`),
        this.#bar,
        this.#stands,
        this.#error,
        this.#notice,
      );
      this.element.append(head, this.#charts.element, this.#checkpoints.element, this.#made, this.#log.element);
      this.#show();
    } catch (error) {
      this.element.append(refusal(error));
    }
  }

  // Changes in place: what is replaced under the pointer cannot be clicked.
  #show(): void {
    const job = this.#feed.jobs.get(this.#id);
    if (!job) return;
    this.#name.textContent = title(job);
    this.#chip.textContent = job.status;
    this.#chip.className = `chip is-${job.status}`;
    this.#stands.textContent = stands(job);
    this.#bar.hidden = !["running", "paused", "cancelling"].includes(job.status);
    if (job.progress) this.#bar.value = job.progress.fraction;
    if (this.#seen === job.status) return;
    this.#seen = job.status;
    this.#buttons.replaceChildren(...this.#actions(job));
    this.#error.replaceChildren(...(job.error ? [failed(job.error)] : []));
    void this.#showMade();
  }

  #actions(job: Job): HTMLElement[] {
    const verb = (name: string, label: string) =>
      button(label, () => this.#do(async () => this.#feed.put(await ask<Job>(`jobs/${job.id}/${name}`, "POST"))));
    const has = (...statuses: string[]) => statuses.includes(job.status);
    return [
      ...(has("running", "queued") ? [verb("pause", "Pause")] : []),
      ...(has("paused") ? [verb("resume", "Resume")] : []),
      ...(has("failed", "cancelled") ? [verb("retry", job.resumable ? "Go on" : "Try again")] : []),
      ...(has("running", "queued", "paused") ? [verb("cancel", "Stop")] : []),
      h("a", { class: "action", href: `#new?clone=${job.id}` }, "Again with changes"),
      button("Rename", () => this.#rename(job)),
      ...(ENDED.includes(job.status) ? [button("Delete", () => this.#delete(job))] : []),
    ];
  }

  async #do(act: () => Promise<unknown>): Promise<void> {
    this.#notice.replaceChildren();
    try {
      await act();
    } catch (error) {
      this.#notice.replaceChildren(refusal(error));
    }
  }

  async #rename(job: Job): Promise<void> {
    const name = prompt("Name of the job", job.name ?? "");
    if (name !== null) {
      await this.#do(async () => this.#feed.put(await ask<Job>(`jobs/${job.id}`, "PATCH", { name: name || null })));
    }
  }

  // It is gone from here at once, and from the server when nobody has taken it back.
  #delete(job: Job): void {
    let isWanted = false;
    const undo = button("Undo", () => {
      isWanted = true;
      this.#notice.replaceChildren();
    });
    this.#notice.replaceChildren(h("p", { class: "toast", role: "status" }, "This job will be deleted; what it made stays. ", undo));
    setTimeout(() => {
      if (isWanted) return;
      void this.#do(async () => {
        await ask(`jobs/${job.id}`, "DELETE");
        this.#feed.forget(job.id);
        if (!this.#isClosed) location.hash = "#jobs";
      });
    }, REGRET);
  }

  async #showMade(): Promise<void> {
    const id = this.#id;
    const job = this.#feed.jobs.get(id);
    if (!job || this.#isClosed) return;
    const artifacts = await ask<List<Artifact>>(`jobs/${id}/artifacts`).catch(() => ({ data: [] }));
    const report = job.kind === "policy.evaluate" && artifacts.data.find(({ name }) => name === "report.json");
    const reports = report ? await ask<Evaluation[]>(`artifacts/${report.hash}`).catch(() => []) : [];
    this.#made.replaceChildren(
      ...(reports.length > 0 ? [section("Evaluation", evaluations(reports))] : []),
      section("What came of it", outputs(job), files(artifacts.data)),
      section("What it was told", facts(parameters(job))),
    );
  }
}

function stands(job: Job): string {
  if (job.status === "queued") return job.attempt > 0 ? "It waits to go on." : "It waits for its turn.";
  if (job.status === "cancelling") return "It is stopping.";
  if (ENDED.includes(job.status) && job.started_at && job.finished_at) {
    const took = (Date.parse(job.finished_at) - Date.parse(job.started_at)) / 1000;
    return `${when(job.started_at)}, ${duration(took)}${job.attempt > 1 ? `, begun ${job.attempt} times` : ""}`;
  }
  return progressInWords(job);
}

function failed({ message, hint, code, param }: NonNullable<Job["error"]>): HTMLElement {
  return failureCard(message, hint ?? "", [code, param].filter(Boolean).join(" "));
}

function outputs(job: Job): HTMLElement | string {
  const { dataset_id, model_id } = job.outputs;
  const pairs: [string, Node | string][] = [];
  if (dataset_id) pairs.push(["Dataset", link(`datasets/${dataset_id}`, dataset_id)]);
  if (model_id) pairs.push(["Model", link(`models/${model_id}`, model_id)]);
  if (model_id && job.kind === "policy.train") pairs.push(["Demo", demo(`model=${model_id}`, "Try it in the demo")]);
  if (pairs.length > 0) return facts(pairs);
  return ENDED.includes(job.status) ? "" : "Nothing yet.";
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
  const worker: [string, string][] = job.worker ? [["worker", `${job.worker.host}, ngf ${job.worker.version}`]] : [];
  return [...set.map(([name, given]): [string, Node | string] => [name, value(name, given)]), ...worker];
}
