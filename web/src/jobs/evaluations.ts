// Evaluation table: success rates, and a demo link for each failed attempt.

import type { ImportOptions } from "../demo/worker/messages";
import { type List, requestJson } from "../common/api";
import { h } from "../common/dom";
import { label, percent } from "../common/numbers";
import { link, table } from "../common/components";
import { outOf } from "../common/strings";
import { buildLink } from "../demo/share/share_link";
import { EVALUATION, FAILURES } from "./strings";
import type { AttemptResult, Evaluation, Job } from "./types";

// Controller whose attempts have share links; links cannot express the control conditions.
const POLICY = "policy";
// Largest seed of a share link.
const MAX_SEED = 0xffffffff;

// `job`: job that ran the evaluation; needed for share links.
export function evaluationTable(reports: Evaluation[], job: Job | null = null): HTMLElement {
  const meshes = new Map<string, HTMLElement[]>();
  const rows = reports.map((report) => [
    objectName(report.object, meshes),
    report.job ? link(`jobs/${report.job}`, report.policy) : report.policy,
    intervalBar(report),
    outOf(report.lifted, report.attempts),
    `${percent(report.wilson95[0])} – ${percent(report.wilson95[1])}`,
    h("div", { class: "reasons" }, failures(report, job)),
    String(report.seed),
  ]);
  if (meshes.size > 0) void showMeshNames(meshes);
  return table(EVALUATION.head, rows, [3, 4]);
}

// Name of an object. A mesh has its id until its name is fetched.
function objectName(name: string, meshes: Map<string, HTMLElement[]>): Node | string {
  if (!name.startsWith("msh_")) return label(name);
  const text = h("span", { title: name }, name);
  meshes.set(name, [...(meshes.get(name) ?? []), text]);
  return text;
}

// Deleted meshes, and meshes beyond the newest 100, keep their id.
async function showMeshNames(meshes: Map<string, HTMLElement[]>): Promise<void> {
  const { data } = await requestJson<List<{ id: string; name: string }>>("meshes?limit=100").catch(() => ({ data: [] }));
  for (const { id, name } of data) for (const text of meshes.get(id) ?? []) text.textContent = name;
}

// Bar from 0 to 1 with success rate and confidence interval.
function intervalBar({ lifted, attempts, wilson95 }: Evaluation): HTMLElement {
  const [interval, mark] = [h("span"), h("i")];
  interval.style.left = `${100 * wilson95[0]}%`;
  interval.style.right = `${100 * (1 - wilson95[1])}%`;
  mark.style.left = `${(100 * lifted) / Math.max(1, attempts)}%`;
  return h("div", { class: "interval", "aria-hidden": "true" }, interval, mark);
}

// Failure counts by reason, with the failed attempts as links if they can be reproduced.
function failures(report: Evaluation, job: Job | null): Node | string {
  const counts = Object.entries(report.failures).map(([reason, count]) => `${count} ${reasonText(reason)}`);
  const failed = (report.rows ?? []).filter(({ outcome }) => outcome.result === "failed");
  if (failed.length === 0 || !job || !isReproducible(report, job)) return counts.join(", ");
  const item = (attempt: AttemptResult) => {
    const text = EVALUATION.attempt(attempt.seed, reasonText(attempt.outcome.reason ?? ""));
    return h("li", {}, h("a", { href: shareLink(report, attempt, job), target: "_blank", rel: "noopener" }, text));
  };
  return h("details", { class: "attempts" }, h("summary", {}, counts.join(", ")), h("ul", {}, ...failed.map(item)));
}

function reasonText(reason: string): string {
  return FAILURES[reason] ?? reason.replaceAll("_", " ");
}

// Whether a share link reproduces the attempts: it cannot express densities or 64-bit seeds, and the planner has no
// model hash.
function isReproducible({ policy, model_hash, seed, attempts }: Evaluation, { params }: Job): boolean {
  return policy === POLICY && model_hash != null && params["density_kg_m3"] == null && seed + attempts <= MAX_SEED;
}

// Share link that reruns the attempt in the demo and compares the final state hash.
function shareLink(report: Evaluation, { seed, pose: [x, y, yaw], final_state_hash }: AttemptResult, { params }: Job): string {
  const { mesh_id, mass_kg, model_id } = params;
  const isMesh = typeof mesh_id === "string";
  const orientation = report.orientation ?? ("asInFile" as const);
  const attempt = {
    object: report.object,
    objectHash: report.object_hash,
    options: isMesh ? { ...meshSize(params), massKg: Number(mass_kg), orientation } : null,
    mesh: isMesh ? mesh_id : null,
    pose: { x, y, yaw },
    placedByHand: false,
    seed,
    model: String(model_id),
    modelHash: report.model_hash ?? null,
    sceneHash: report.scene_hash,
    view: null,
    tick: null,
    finalStateHash: final_state_hash,
  };
  return buildLink(attempt, new URL("../", location.href).href);
}

// Size and up axis of the mesh of a job.
function meshSize(params: Job["params"]): Pick<ImportOptions, "unit" | "sizeM" | "scale" | "up"> {
  const { unit, size_m, scale, up } = params;
  return {
    unit: (unit ?? null) as ImportOptions["unit"],
    sizeM: typeof size_m === "number" ? size_m : null,
    scale: typeof scale === "number" ? scale : null,
    up: (up ?? null) as ImportOptions["up"],
  };
}
