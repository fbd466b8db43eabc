// Batch of attempts: success counts with intervals, failures with their reasons, replay of each attempt.

import { element, h } from "../../common/dom";
import { percent } from "../../common/numbers";
import { outOf } from "../../common/strings";
import type { EventBus } from "../app/event_bus";
import { BATCH } from "../app/strings";
import { download } from "../files/download";
import { BatchWorkers, numBatchWorkers } from "../worker/batch_workers";
import type { FailureEvent, WorkerRequest } from "../worker/messages";
import type { AttemptFinished, BatchAttempt, Model, Tally } from "../worker/protocol";
import { asSecondary } from "../worker/worker_client";
import { AttemptTable } from "./attempt_table";
import { insertBySeed } from "./seed_order";
import { WorkspaceMap } from "./workspace_map";

export interface BatchEvents {
  send(request: WorkerRequest): void;
  // First seed of the batch.
  seed(): number;
  // Names of the loaded policy and, if there is one, of the compared policy.
  names(): string[];
  // Runs the attempt of this seed in the view.
  replay(seed: number): void;
  // Sends a request that is not the user's.
  sendInternal(request: WorkerRequest): void;
  report(failure: FailureEvent): void;
}

// Attempts of one policy.
interface PolicyRun {
  name: string;
  attempts: BatchAttempt[];
  tally: Tally | null;
  isFinished: boolean;
}

export class BatchPanel {
  readonly #events: BatchEvents;
  readonly #button = element("batch-run", HTMLButtonElement);
  readonly #count = element("batch-count", HTMLSelectElement);
  readonly #bar = element("batch-bar", HTMLProgressElement);
  readonly #csv = element("batch-csv", HTMLButtonElement);
  readonly #summary = element("batch-summary", HTMLElement);
  readonly #comparison = element("batch-comparison", HTMLElement);
  readonly #failures = element("batch-failures", HTMLUListElement);
  readonly #map: WorkspaceMap;
  readonly #table: AttemptTable;
  // Runs of the loaded and the compared policy, on the same seeds.
  #runs: PolicyRun[] = [];
  #numAttempts = 0;
  // Id of the current batch. Events of earlier batches are ignored.
  #batchId = 0;
  // Loaded policy, and the workers that help with the batch.
  #model: Model | null = null;
  #workers: BatchWorkers | null = null;

  constructor(bus: EventBus, events: BatchEvents) {
    this.#events = events;
    this.#map = new WorkspaceMap((seed) => events.replay(seed));
    this.#table = new AttemptTable((seed) => events.replay(seed));
    this.#button.addEventListener("click", () => (this.#isRunning ? events.send({ kind: "cancelBatch" }) : this.#start()));
    this.#csv.addEventListener("click", () => download("attempts.csv", new Blob([csv(this.#runs)], { type: "text/csv" })));
    bus.on("ready", ({ workspace }) => this.#map.setWorkspace(workspace));
    bus.on("objectChanged", () => this.#clear());
    bus.on("modelChanged", () => this.#clear());
    bus.on("model", (model) => {
      this.#model = model;
      this.#button.disabled = false;
    });
    bus.on("batchStarted", ({ object }) => this.#startWorkers(object));
    bus.on("attemptsTaken", ({ worker, seed, attempts }) => this.#workers?.run(worker, seed, attempts));
    bus.on("attemptFinished", (attempt) => this.#add(attempt, 0));
    bus.on("secondAttemptFinished", ({ attempt }) => this.#add(attempt, 1));
    bus.on("batchFinished", ({ batchId }) => this.#end(0, batchId));
    bus.on("secondBatchFinished", ({ batchId }) => this.#end(1, batchId));
    bus.on("stopped", () => this.#stop());
  }

  get #isRunning(): boolean {
    return this.#runs.some(({ isFinished }) => !isFinished);
  }

  #start(): void {
    this.#reset();
    this.#numAttempts = Number(this.#count.value);
    this.#runs = this.#events.names().map((name) => ({ name, attempts: [], tally: null, isFinished: false }));
    this.#show();
    this.#batchId += 1;
    // A second policy runs in a worker of its own. The planner needs the name of the object, which only the page's worker has.
    const workers = this.#runs.length > 1 || !this.#model?.id ? 1 : numBatchWorkers();
    this.#events.send({ kind: "batch", seed: this.#events.seed(), attempts: this.#numAttempts, batchId: this.#batchId, workers });
  }

  #startWorkers(object: Uint8Array): void {
    const { id, hash } = this.#model ?? {};
    if (!this.#isRunning || !id || !hash) return;
    this.#workers?.terminate();
    this.#workers = new BatchWorkers(this.#batchId, object, { id, hash }, {
      send: this.#events.sendInternal,
      report: (failure) => {
        this.#events.send({ kind: "cancelBatch" });
        this.#events.report(asSecondary(failure, BATCH.aborted));
      },
    });
  }

  // Adds an attempt of the loaded (0) or the compared (1) policy. The map shows only the loaded one.
  #add({ batchId, attempt, batchTally }: AttemptFinished, policy: 0 | 1): void {
    const run = this.#runs[policy];
    if (!run || batchId !== this.#batchId) return;
    run.attempts.push(attempt);
    run.tally = batchTally;
    if (policy === 0) this.#map.add(attempt);
    this.#table.add(attempt, this.#runs.length > 1 ? run.name : null);
    if (!attempt.lifted) insertBySeed(this.#failures, this.#failureItem(run, attempt), attempt.seed);
    this.#show();
  }

  // The batch of one policy has finished; null is the current batch.
  #end(policy: 0 | 1, batchId: number | null): void {
    const run = this.#runs[policy];
    if (!run || run.isFinished || (batchId ?? this.#batchId) !== this.#batchId) return;
    run.isFinished = true;
    if (policy === 0) this.#endWorkers();
    this.#show();
    // Screen readers announce only the final result.
    if (!this.#isRunning) {
      element("announcement", HTMLElement).textContent = this.#comparison.textContent || this.#summary.textContent;
    }
  }

  // The worker has stopped. The results so far stay.
  #stop(): void {
    for (const run of this.#runs) run.isFinished = true;
    this.#endWorkers();
    this.#show();
    this.#button.disabled = true;
  }

  #endWorkers(): void {
    this.#workers?.terminate();
    this.#workers = null;
  }

  // Discards the results after a change of object or policy. The worker ends the batch before it reports the
  // change, so a batch that is still running was started afterwards and continues.
  #clear(): void {
    if (this.#runs[0]?.isFinished === false) return;
    if (this.#isRunning) this.#events.send({ kind: "cancelBatch" });
    this.#reset();
    this.#show();
  }

  #reset(): void {
    this.#runs = [];
    this.#failures.replaceChildren();
    this.#map.clear();
    this.#table.clear();
  }

  #show(): void {
    const [first, second] = this.#runs;
    this.#button.textContent = this.#isRunning ? BATCH.stop : BATCH.run;
    this.#bar.hidden = !this.#isRunning;
    this.#bar.max = this.#numAttempts * this.#runs.length;
    this.#bar.value = this.#runs.reduce((sum, { attempts }) => sum + attempts.length, 0);
    const hasResult = first !== undefined && first.attempts.length > 0;
    this.#summary.textContent = hasResult ? (second ? lifted : liftedWithInterval)(first) : "";
    const isPaired = first && second && second.attempts.length > 0;
    this.#comparison.textContent = isPaired ? `${labelled(first)}, ${labelled(second)}. ${paired(first, second)}` : "";
    this.#csv.hidden = !hasResult;
  }

  #failureItem({ name }: PolicyRun, { seed, text }: BatchAttempt): HTMLLIElement {
    const button = h("button", { type: "button", class: "quiet", click: () => this.#events.replay(seed) }, BATCH.replay);
    const outcome = BATCH.outcome(seed, text);
    return h("li", {}, h("span", {}, this.#runs.length > 1 ? BATCH.ofPolicy(name, outcome) : outcome), button);
  }
}

function lifted({ attempts, tally }: PolicyRun): string {
  return outOf(tally?.lifted ?? 0, attempts.length);
}

function liftedWithInterval(run: PolicyRun): string {
  const interval = run.tally?.interval;
  return interval ? BATCH.interval(lifted(run), percent(interval[0]), percent(interval[1])) : lifted(run);
}

function labelled(run: PolicyRun): string {
  return BATCH.ofPolicy(run.name, liftedWithInterval(run));
}

// Numbers of seeds on which only one of the policies succeeded, among the seeds that both have tried.
function paired(first: PolicyRun, second: PolicyRun): string {
  const outcomes = new Map(second.attempts.map(({ seed, lifted }) => [seed, lifted]));
  const both = first.attempts.filter(({ seed }) => outcomes.has(seed));
  if (both.length === 0) return "";
  const only = (isFirst: boolean) => both.filter(({ seed, lifted }) => lifted === isFirst && outcomes.get(seed) === !isFirst).length;
  return BATCH.paired(first.name, only(true), second.name, only(false), both.length);
}

function csv(runs: PolicyRun[]): string {
  const line = (name: string, { seed, pose, lifted, text, time, finalStateHash }: BatchAttempt) =>
    [name, seed, pose.x, pose.y, pose.yaw, lifted, `"${text}"`, time.toFixed(3), finalStateHash].join(",");
  const lines = runs.flatMap(({ name, attempts }) => attempts.toSorted((a, b) => a.seed - b.seed).map((attempt) => line(name, attempt)));
  return ["policy,seed,x_m,y_m,yaw_rad,lifted,outcome,duration_s,final_state_hash", ...lines, ""].join("\n");
}
