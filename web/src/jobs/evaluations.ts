// Evaluations as a table: how often what was lifted, and each attempt that failed as a link to it.

import { ask, type List } from "../common/api";
import { h } from "../common/dom";
import { label, percent } from "../common/numbers";
import { link, table } from "../common/parts";
import { outOf } from "../common/strings";
import { linkOf } from "../demo/share";
import { EVALUATION, FAILURES } from "./strings";
import type { Attempted, Evaluation, Job } from "./types";

// Who acted in the rows that are links: controls do what a link does not say.
const POLICY = "policy";
const LARGEST_SEED = 0xffffffff;

// The attempts are links where it is known which job made them, and with which object.
export function evaluations(reports: Evaluation[], job: Job | null = null): HTMLElement {
  const meshes = new Map<string, HTMLElement[]>();
  const rows = reports.map((report) => [
    object(report.object, meshes),
    report.job ? link(`jobs/${report.job}`, report.policy) : report.policy,
    share(report),
    outOf(report.lifted, report.attempts),
    `${percent(report.wilson95[0])} – ${percent(report.wilson95[1])}`,
    h("div", { class: "reasons" }, failures(report, job)),
    String(report.seed),
  ]);
  if (meshes.size > 0) void nameMeshes(meshes);
  return table(EVALUATION.head, rows, [3, 4]);
}

// A mesh is called by its id until its name is known.
function object(name: string, meshes: Map<string, HTMLElement[]>): Node | string {
  if (!name.startsWith("msh_")) return label(name);
  const shown = h("span", { title: name }, name);
  meshes.set(name, [...(meshes.get(name) ?? []), shown]);
  return shown;
}

// One that was deleted meanwhile keeps its id, and so do those that are older than so many.
async function nameMeshes(meshes: Map<string, HTMLElement[]>): Promise<void> {
  const { data } = await ask<List<{ id: string; name: string }>>("meshes?limit=100").catch(() => ({ data: [] }));
  for (const { id, name } of data) for (const shown of meshes.get(id) ?? []) shown.textContent = name;
}

// A bar from 0 to 1 with its interval.
function share({ lifted, attempts, wilson95 }: Evaluation): HTMLElement {
  const [band, mark] = [h("span"), h("i")];
  band.style.left = `${100 * wilson95[0]}%`;
  band.style.right = `${100 * (1 - wilson95[1])}%`;
  mark.style.left = `${(100 * lifted) / Math.max(1, attempts)}%`;
  return h("div", { class: "interval", "aria-hidden": "true" }, band, mark);
}

// Counts by reason, and behind them the attempts.
function failures(report: Evaluation, job: Job | null): Node | string {
  const counts = Object.entries(report.failures).map(([reason, count]) => `${count} ${inWords(reason)}`);
  const failed = (report.rows ?? []).filter(({ verdict }) => verdict.outcome === "failed");
  if (failed.length === 0 || !job || !isTold(report, job)) return counts.join(", ");
  const item = (attempt: Attempted) => {
    const text = EVALUATION.attempt(attempt.seed, inWords(attempt.verdict.reason ?? ""));
    return h("li", {}, h("a", { href: address(report, attempt, job), target: "_blank", rel: "noopener" }, text));
  };
  return h("details", { class: "attempts" }, h("summary", {}, counts.join(", ")), h("ul", {}, ...failed.map(item)));
}

function inWords(reason: string): string {
  return FAILURES[reason] ?? reason.replaceAll("_", " ");
}

// Whether a link says all that the attempts depended on: the page does not know of densities and of seeds that long, and
// the planner is no model of which there is a hash.
function isTold({ policy, model_hash, seed, attempts }: Evaluation, { params }: Job): boolean {
  return policy === POLICY && model_hash != null && params["density_kg_m3"] == null && seed + attempts <= LARGEST_SEED;
}

// Where the demo makes an attempt again, and compares how it ends.
function address(report: Evaluation, { seed, pose: [x, y, yaw], state_hash }: Attempted, { params }: Job): string {
  const { mesh_id, mass_kg, model_id } = params;
  const isFile = typeof mesh_id === "string";
  const shared = {
    object: report.object,
    objectHash: report.object_hash,
    told: isFile ? { unit: null, massKg: Number(mass_kg), stands: report.stands ?? ("asInFile" as const) } : null,
    mesh: isFile ? mesh_id : null,
    pose: { x, y, yaw },
    placed: false,
    seed,
    model: String(model_id),
    modelHash: report.model_hash,
    scene: report.scene_hash,
    view: null,
    tick: null,
    end: state_hash,
  };
  return linkOf(shared, new URL("../", location.href).href);
}
