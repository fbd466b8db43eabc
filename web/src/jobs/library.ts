// What jobs made and people brought: datasets, models and meshes, each as a list and one by one.

import { API, ask, type List, send } from "../common/api";
import { button, h } from "../common/dom";
import { download, facts, link, refusal, section, table } from "../common/parts";
import { count, label, size, when } from "../common/numbers";
import { outOf } from "../common/strings";
import { demo, evaluations } from "./parts";
import { DATASET, DATASETS, DEMO, EVALUATION, FACTS, MESHES, MODEL, MODELS } from "./strings";
import type { Evaluation } from "./types";
import type { View } from "./view";

// A view that is there once what it shows has been fetched.
function fetched(make: () => Promise<Node[]>): View {
  const element = h("article");
  make().then(
    (nodes) => element.append(...nodes),
    (error: unknown) => element.append(refusal(error)),
  );
  return { element };
}

interface DatasetRecord {
  id: string;
  bytes: number;
  job: string;
  created_at: string;
  config: { objects: string[]; poses: number; trajectories: number; seed: number };
  summary: Record<string, { fates: Record<string, number>; poses: number; enough: number }>;
}

interface EpisodeEntry {
  index: number;
  object: string;
  pose_index: number;
  pose: [number, number, number];
}

const kept = ({ summary }: DatasetRecord) =>
  Object.values(summary).reduce((sum, { fates }) => sum + (fates["kept"] ?? 0), 0);

export function datasets(): View {
  return fetched(async () => {
    const { data } = await ask<List<DatasetRecord>>("datasets?limit=100");
    const rows = data.map((one) => [
      link(`datasets/${one.id}`, one.id),
      one.config.objects.length > 3 ? DATASETS.objects(one.config.objects.length) : one.config.objects.map(label).join(", "),
      count(kept(one)),
      size(one.bytes),
      when(one.created_at),
    ]);
    const none = h("p", { class: "hint" }, DATASETS.none);
    return [h("h1", {}, DATASETS.title), rows.length > 0 ? table(DATASETS.head, rows, [2, 3]) : none];
  });
}

export function dataset(id: string): View {
  return fetched(async () => {
    const one = await ask<DatasetRecord>(`datasets/${id}`);
    const rows = Object.entries(one.summary).map(([object, { fates, poses, enough }]) => {
      const all = Object.values(fates).reduce((a, b) => a + b, 0);
      const others = Object.entries(fates)
        .filter(([fate, n]) => fate !== "kept" && n > 0)
        .map(([fate, n]) => `${count(n)} ${fate.replaceAll("_", " ")}`);
      return [label(object), outOf(count(fates["kept"] ?? 0), count(all)), outOf(enough, poses), others.join(", ")];
    });
    return [
      h("h1", {}, DATASET.title),
      facts([
        [FACTS.id, one.id],
        [FACTS.madeBy, link(`jobs/${one.job}`, one.job)],
        [FACTS.made, when(one.created_at)],
        [FACTS.size, size(one.bytes)],
        [FACTS.seed, String(one.config.seed)],
      ]),
      section(DATASET.objects, table(DATASET.objectsHead, rows, [1, 2])),
      section(DATASET.episodes, episodes(id)),
    ];
  });
}

// Page after page of what was kept, each to be played.
function episodes(id: string): HTMLElement {
  const body = h("div");
  let last = -1;
  const more = button(DATASET.more, () => fetchMore());
  const fetchMore = async () => {
    const page = await ask<List<EpisodeEntry>>(`datasets/${id}/episodes?limit=20${last >= 0 ? `&after=${last}` : ""}`);
    last = page.data.at(-1)?.index ?? last;
    const rows = page.data.map(({ index, object, pose_index, pose: [x, y, yaw] }) => [
      String(index),
      label(object),
      String(pose_index),
      `${(100 * x).toFixed(1)}, ${(100 * y).toFixed(1)} cm, ${((180 / Math.PI) * yaw).toFixed(0)}°`,
      demo(`episode=${id}/${index}`, DEMO.play),
      download(new URL(`datasets/${id}/episodes/${index}`, API).href, `${id}-${index}.json`),
    ]);
    body.append(table(DATASET.episodesHead, rows, [0, 2]));
    more.hidden = !page.has_more;
  };
  fetchMore().catch((error: unknown) => body.append(refusal(error)));
  return h("div", {}, body, more);
}

interface ModelRecord {
  id: string;
  kind?: string;
  job?: string;
  step?: number | null;
  created_at?: string;
  files: Record<string, { url: string; bytes: number; blake3: string }>;
  card?: { evaluation?: Evaluation[] } | null;
  evaluations?: { job: string; reports: Evaluation[] }[];
}

export function models(): View {
  return fetched(async () => {
    const { data } = await ask<List<ModelRecord>>("models");
    const rows = data.map((one) => [
      link(`models/${one.id}`, one.id),
      one.kind ?? "policy",
      one.step == null ? "" : one.step.toLocaleString("en"),
      one.created_at ? when(one.created_at) : MODELS.builtIn,
      one.kind === "encoder" ? "" : demo(`model=${one.id}`, DEMO.tryIn),
    ]);
    return [h("h1", {}, MODELS.title), table(MODELS.head, rows, [2])];
  });
}

export function model(id: string): View {
  return fetched(async () => {
    const one = await ask<ModelRecord>(`models/${id}`);
    const isPolicy = one.kind !== "encoder";
    const reports = [...(one.evaluations ?? []).flatMap(({ reports }) => reports), ...(one.card?.evaluation ?? [])];
    const about: [string, Node | string][] = [[FACTS.id, one.id]];
    if (one.job) about.push([FACTS.madeBy, link(`jobs/${one.job}`, one.job)]);
    if (one.step != null) about.push([FACTS.step, one.step.toLocaleString("en")]);
    if (isPolicy) about.push([FACTS.demo, demo(`model=${one.id}`, DEMO.tryIt)]);
    const files = Object.entries(one.files).map(([name, { url, bytes, blake3 }]) => [
      download(new URL(`..${url}`, location.href).href, name, bytes),
      h("code", {}, blake3.slice(0, 16)),
    ]);
    return [
      h("h1", {}, MODEL.title),
      facts(about),
      isPolicy &&
        section(
          EVALUATION.title,
          reports.length > 0 ? evaluations(reports) : h("p", { class: "hint" }, EVALUATION.none),
          h("p", {}, link(`new?kind=policy.evaluate&model_id=${one.id}`, EVALUATION.evaluateIt)),
        ),
      section(MODEL.files, table(MODEL.filesHead, files)),
    ].filter((node): node is HTMLElement => node !== false);
  });
}

interface MeshRecord {
  id: string;
  name: string;
  bytes: number;
  report: { extent_m: [number, number, number]; triangles: number; watertight: boolean; reason: string };
}

export function meshes(): View {
  return fetched(async () => {
    const { data } = await ask<List<MeshRecord>>("meshes?limit=100");
    const body = h("div");
    const show = (all: MeshRecord[]) => body.replaceChildren(all.length > 0 ? meshTable(all, refresh) : h("p", { class: "hint" }, MESHES.none));
    const refresh = async () => show((await ask<List<MeshRecord>>("meshes?limit=100")).data);
    const notice = h("div");
    const input = h("input", { type: "file", accept: ".obj,.stl,.ply,.glb", "aria-label": MESHES.file });
    input.addEventListener("change", async () => {
      notice.replaceChildren();
      try {
        for (const file of input.files ?? []) await send(`meshes?name=${encodeURIComponent(file.name)}`, "POST", file);
        await refresh();
      } catch (error) {
        notice.replaceChildren(refusal(error));
      }
      input.value = "";
    });
    show(data);
    return [h("h1", {}, MESHES.title), h("p", { class: "hint" }, MESHES.hint), h("p", {}, input), notice, body];
  });
}

function meshTable(all: MeshRecord[], refresh: () => Promise<void>): HTMLElement {
  const rows = all.map(({ id, name, bytes, report }) => [
    name,
    report.extent_m.map((side) => (100 * side).toFixed(1)).join(" × ") + " cm",
    MESHES.triangles(count(report.triangles), report.watertight),
    size(bytes),
    demo(`mesh=${id}`, DEMO.tryIn),
    link(`new?kind=mesh.prepare&mesh_id=${id}`, MESHES.parts),
    button(MESHES.delete, async () => {
      await ask(`meshes/${id}`, "DELETE");
      await refresh();
    }),
  ]);
  return table(MESHES.head, rows);
}

