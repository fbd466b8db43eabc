// What jobs made and people brought: datasets, models and meshes, each as a list and one by one.

import { API, ask, send } from "../common/api";
import { button, h } from "../common/dom";
import { download, facts, link, refusal, section, table } from "../common/parts";
import { count, label, size, when } from "../common/numbers";
import { outOf } from "../common/strings";
import { evaluations } from "./evaluations";
import { Pages } from "./pages";
import { demo } from "./parts";
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
  const row = (one: DatasetRecord) => [
    link(`datasets/${one.id}`, one.id),
    one.config.objects.length > 3 ? DATASETS.objects(one.config.objects.length) : one.config.objects.map(label).join(", "),
    count(kept(one)),
    size(one.bytes),
    when(one.created_at),
  ];
  const pages = new Pages<DatasetRecord>({
    path: "datasets?limit=100",
    key: ({ id }) => id,
    table: (page) => table(DATASETS.head, page.map(row), [2, 3]),
    none: DATASETS.none,
  });
  return { element: h("article", {}, h("h1", {}, DATASETS.title), pages.element) };
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

// What was kept, each to be played.
function episodes(id: string): HTMLElement {
  const row = ({ index, object, pose_index, pose: [x, y, yaw] }: EpisodeEntry) => [
    String(index),
    label(object),
    String(pose_index),
    `${(100 * x).toFixed(1)}, ${(100 * y).toFixed(1)} cm, ${((180 / Math.PI) * yaw).toFixed(0)}°`,
    demo(`episode=${id}/${index}`, DEMO.play),
    download(new URL(`datasets/${id}/episodes/${index}`, API).href, `${id}-${index}.json`),
  ];
  return new Pages<EpisodeEntry>({
    path: `datasets/${id}/episodes?limit=20`,
    key: ({ index }) => index,
    table: (page) => table(DATASET.episodesHead, page.map(row), [0, 2]),
    none: DATASET.noEpisodes,
  }).element;
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
  const row = (one: ModelRecord) => [
    link(`models/${one.id}`, one.id),
    one.kind ?? "policy",
    one.step == null ? "" : one.step.toLocaleString("en"),
    one.created_at ? when(one.created_at) : MODELS.builtIn,
    one.kind === "encoder" ? "" : demo(`model=${one.id}`, DEMO.tryIn),
  ];
  const pages = new Pages<ModelRecord>({
    path: "models?limit=100",
    key: ({ id }) => id,
    table: (page) => table(MODELS.head, page.map(row), [2]),
    none: MODELS.none,
  });
  return { element: h("article", {}, h("h1", {}, MODELS.title), pages.element) };
}

function ofJob({ job, reports }: { job: string; reports: Evaluation[] }): Evaluation[] {
  return reports.map((report) => ({ ...report, job }));
}

export function model(id: string): View {
  return fetched(async () => {
    const one = await ask<ModelRecord>(`models/${id}`);
    const isPolicy = one.kind !== "encoder";
    const reports = [...(one.evaluations ?? []).flatMap(ofJob), ...(one.card?.evaluation ?? [])];
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
  const pages: Pages<MeshRecord> = new Pages<MeshRecord>({
    path: "meshes?limit=100",
    key: ({ id }) => id,
    table: (page) => meshTable(page, () => pages.begin()),
    none: MESHES.none,
  });
  const notice = h("div");
  const input = h("input", { type: "file", accept: ".obj,.stl,.ply,.off,.glb,.gltf", "aria-label": MESHES.file });
  input.addEventListener("change", async () => {
    notice.replaceChildren();
    try {
      for (const file of input.files ?? []) await send(`meshes?name=${encodeURIComponent(file.name)}`, "POST", file);
      await pages.begin();
    } catch (error) {
      notice.replaceChildren(refusal(error));
    }
    input.value = "";
  });
  const hint = h("p", { class: "hint" }, MESHES.hint);
  return { element: h("article", {}, h("h1", {}, MESHES.title), hint, h("p", {}, input), notice, pages.element) };
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
