// Views of datasets, models and meshes: lists and single records.

import { API, request, requestJson } from "../common/api";
import { button, h } from "../common/dom";
import { MESH_EXTENSIONS } from "../common/constants";
import { caughtErrorCard, download, factList, link, section, table } from "../common/components";
import { byteSize, count, dateTime, label } from "../common/numbers";
import type { Schemas } from "../common/openapi";
import { outOf } from "../common/strings";
import { demoLink } from "./components";
import { evaluationTable } from "./evaluations";
import { PaginatedTable } from "./paginated_table";
import { DATASET, DATASETS, DEMO, EVALUATION, FACTS, MESHES, MODEL, MODELS } from "./strings";
import type { Evaluation } from "./types";
import type { View } from "./main_view";

// View whose content appears once it has been fetched.
function asyncView(load: () => Promise<Node[]>): View {
  const element = h("article");
  let hasFailed = true;
  const show = async () => {
    hasFailed = false;
    try {
      element.replaceChildren(...(await load()));
    } catch (error) {
      hasFailed = true;
      element.replaceChildren(caughtErrorCard(error));
    }
  };
  void show();
  return { element, retry: () => void (hasFailed && show()) };
}

// View of a table below its heading.
function tableView<T>(title: string, records: PaginatedTable<T>, ...above: HTMLElement[]): View {
  return { element: h("article", {}, h("h1", {}, title), ...above, records.element), retry: () => records.retry() };
}

// Configuration and summary are free-form objects in the description.
type DatasetRecord = Omit<Schemas["Dataset"], "config" | "summary"> & {
  config: { objects: string[]; poses: number; trajectories: number; seed: number };
  summary: Record<string, { outcomes: Record<string, number>; poses: number; well_covered: number }>;
};

type EpisodeEntry = Schemas["EpisodeSchema"];

const numKept = ({ summary }: DatasetRecord) =>
  Object.values(summary).reduce((sum, { outcomes }) => sum + (outcomes["kept"] ?? 0), 0);

export function datasets(): View {
  const row = (record: DatasetRecord) => [
    link(`datasets/${record.id}`, record.id),
    record.config.objects.length > 3 ? DATASETS.objects(record.config.objects.length) : record.config.objects.map(label).join(", "),
    count(numKept(record)),
    byteSize(record.bytes),
    dateTime(record.created_at),
  ];
  const records = new PaginatedTable<DatasetRecord>({
    path: "datasets?limit=100",
    key: ({ id }) => id,
    table: (page) => table(DATASETS.head, page.map(row), [2, 3]),
    none: DATASETS.none,
  });
  return tableView(DATASETS.title, records);
}

export function dataset(id: string): View {
  return asyncView(async () => {
    const record = await requestJson<DatasetRecord>(`datasets/${id}`);
    const rows = Object.entries(record.summary).map(([object, { outcomes, poses, well_covered }]) => {
      const total = Object.values(outcomes).reduce((a, b) => a + b, 0);
      const rejected = Object.entries(outcomes)
        .filter(([outcome, n]) => outcome !== "kept" && n > 0)
        .map(([outcome, n]) => `${count(n)} ${outcome.replaceAll("_", " ")}`);
      return [label(object), outOf(count(outcomes["kept"] ?? 0), count(total)), outOf(well_covered, poses), rejected.join(", ")];
    });
    return [
      h("h1", {}, DATASET.title),
      factList([
        [FACTS.id, record.id],
        [FACTS.createdBy, record.job ? link(`jobs/${record.job}`, record.job) : FACTS.imported],
        [FACTS.created, dateTime(record.created_at)],
        [FACTS.files, download(new URL(`datasets/${id}/archive`, API).href, `${id}.tar`, record.bytes)],
        [FACTS.seed, String(record.config.seed)],
      ]),
      section(DATASET.objects, table(DATASET.objectsHead, rows, [1, 2])),
      section(DATASET.episodes, episodes(id)),
    ];
  });
}

// Demonstrations of a dataset, each with a link that plays it in the demo.
function episodes(id: string): HTMLElement {
  const row = ({ index, object, pose_index, pose: [x, y, yaw] }: EpisodeEntry) => [
    String(index),
    label(object),
    String(pose_index),
    `${(100 * x).toFixed(1)}, ${(100 * y).toFixed(1)} cm, ${((180 / Math.PI) * yaw).toFixed(0)}°`,
    demoLink(`episode=${id}/${index}`, DEMO.play),
    download(new URL(`datasets/${id}/episodes/${index}`, API).href, `${id}-${index}.json`),
  ];
  return new PaginatedTable<EpisodeEntry>({
    path: `datasets/${id}/episodes?limit=20`,
    key: ({ index }) => index,
    table: (page) => table(DATASET.episodesHead, page.map(row), [0, 2]),
    none: DATASET.noEpisodes,
  }).element;
}

type ModelRecord = Omit<Schemas["Model"], "card"> & { card?: { evaluation?: Evaluation[] } | null };

export function models(): View {
  const row = (record: ModelRecord) => [
    link(`models/${record.id}`, record.id),
    record.kind ?? "policy",
    record.step == null ? "" : record.step.toLocaleString("en"),
    record.created_at ? dateTime(record.created_at) : MODELS.builtIn,
    record.kind === "encoder" ? "" : demoLink(`model=${record.id}`, DEMO.tryIn),
  ];
  const records = new PaginatedTable<ModelRecord>({
    path: "models?limit=100",
    key: ({ id }) => id,
    table: (page) => table(MODELS.head, page.map(row), [2]),
    none: MODELS.none,
  });
  return tableView(MODELS.title, records);
}

function withJob({ job, reports }: { job: string; reports: Evaluation[] }): Evaluation[] {
  return reports.map((report) => ({ ...report, job }));
}

export function model(id: string): View {
  return asyncView(async () => {
    const record = await requestJson<ModelRecord>(`models/${id}`);
    const isPolicy = record.kind !== "encoder";
    const reports = [...(record.evaluations ?? []).flatMap(withJob), ...(record.card?.evaluation ?? [])];
    const facts: [string, Node | string][] = [[FACTS.id, record.id]];
    if (record.job) facts.push([FACTS.createdBy, link(`jobs/${record.job}`, record.job)]);
    if (record.step != null) facts.push([FACTS.step, record.step.toLocaleString("en")]);
    if (isPolicy) facts.push([FACTS.demo, demoLink(`model=${record.id}`, DEMO.tryIt)]);
    const files = Object.entries(record.files).map(([name, { url, bytes, blake3 }]) => [
      download(new URL(`..${url}`, location.href).href, name, bytes),
      h("code", {}, blake3.slice(0, 16)),
    ]);
    return [
      h("h1", {}, MODEL.title),
      factList(facts),
      isPolicy &&
        section(
          EVALUATION.title,
          reports.length > 0 ? evaluationTable(reports) : h("p", { class: "hint" }, EVALUATION.none),
          h("p", {}, link(`new?kind=policy.evaluate&model_id=${record.id}`, EVALUATION.evaluate)),
        ),
      section(MODEL.files, table(MODEL.filesHead, files)),
    ].filter((node): node is HTMLElement => node !== false);
  });
}

type MeshRecord = Schemas["Mesh"];

export function meshes(): View {
  const records: PaginatedTable<MeshRecord> = new PaginatedTable<MeshRecord>({
    path: "meshes?limit=100",
    key: ({ id }) => id,
    table: (page) => meshTable(page, () => records.reload()),
    none: MESHES.none,
  });
  const errors = h("div");
  const input = h("input", { type: "file", accept: MESH_EXTENSIONS.map((name) => `.${name}`).join(), "aria-label": MESHES.file });
  input.addEventListener("change", async () => {
    errors.replaceChildren();
    try {
      for (const file of input.files ?? []) await request(`meshes?name=${encodeURIComponent(file.name)}`, "POST", file);
      await records.reload();
    } catch (error) {
      errors.replaceChildren(caughtErrorCard(error));
    }
    input.value = "";
  });
  const hint = h("p", { class: "hint" }, MESHES.hint);
  return tableView(MESHES.title, records, hint, h("p", {}, input), errors);
}

function meshTable(records: MeshRecord[], reload: () => Promise<void>): HTMLElement {
  const rows = records.map(({ id, name, bytes, summary }) => [
    name,
    summary.extent_m.map((side) => (100 * side).toFixed(1)).join(" × ") + " cm",
    MESHES.triangles(count(summary.triangles), summary.watertight),
    byteSize(bytes),
    demoLink(`mesh=${id}`, DEMO.tryIn),
    link(`new?kind=mesh.prepare&mesh_id=${id}`, MESHES.inspect),
    button(MESHES.delete, async () => {
      await requestJson(`meshes/${id}`, "DELETE");
      await reload();
    }),
  ]);
  return table(MESHES.head, rows);
}
