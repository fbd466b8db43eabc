// What jobs made and people brought: datasets, models and meshes, each as a list and one by one.

import { API, ask, type List, send } from "../common/api";
import { button, h } from "../common/dom";
import { download, facts, link, refusal, section, table } from "../common/parts";
import { count, label, size, when } from "../common/words";
import { demo, evaluations } from "./parts";
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
      one.config.objects.length > 3 ? `${one.config.objects.length} objects` : one.config.objects.map(label).join(", "),
      count(kept(one)),
      size(one.bytes),
      when(one.created_at),
    ]);
    const none = h("p", { class: "hint" }, "None yet. A job makes one.");
    return [h("h1", {}, "Datasets"), rows.length > 0 ? table(["Dataset", "Of", "Demonstrations", "Size", "Made"], rows, [2, 3]) : none];
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
      return [label(object), `${count(fates["kept"] ?? 0)} of ${count(all)}`, `${enough} of ${poses}`, others.join(", ")];
    });
    return [
      h("h1", {}, "Dataset"),
      facts([
        ["Id", one.id],
        ["Made by", link(`jobs/${one.job}`, one.job)],
        ["Made", when(one.created_at)],
        ["Size", size(one.bytes)],
        ["Seed", String(one.config.seed)],
      ]),
      section("Objects", table(["Object", "Kept", "Poses with enough", "The others"], rows, [1, 2])),
      section("Demonstrations", episodes(id)),
    ];
  });
}

// Page after page of what was kept, each to be played.
function episodes(id: string): HTMLElement {
  const body = h("div");
  let last = -1;
  const more = button("More", () => fetchMore());
  const fetchMore = async () => {
    const page = await ask<List<EpisodeEntry>>(`datasets/${id}/episodes?limit=20${last >= 0 ? `&after=${last}` : ""}`);
    last = page.data.at(-1)?.index ?? last;
    const rows = page.data.map(({ index, object, pose_index, pose: [x, y, yaw] }) => [
      String(index),
      label(object),
      String(pose_index),
      `${(100 * x).toFixed(1)}, ${(100 * y).toFixed(1)} cm, ${((180 / Math.PI) * yaw).toFixed(0)}°`,
      demo(`episode=${id}/${index}`, "Play"),
      download(new URL(`datasets/${id}/episodes/${index}`, API).href, `${id}-${index}.json`),
    ]);
    body.append(table(["Number", "Object", "Pose", "x, y, turn", "", "File"], rows, [0, 2]));
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
      one.created_at ? when(one.created_at) : "came with the program",
      one.kind === "encoder" ? "" : demo(`model=${one.id}`, "Try in demo"),
    ]);
    return [h("h1", {}, "Models"), table(["Model", "Kind", "Step", "Made", ""], rows, [2])];
  });
}

export function model(id: string): View {
  return fetched(async () => {
    const one = await ask<ModelRecord>(`models/${id}`);
    const isPolicy = one.kind !== "encoder";
    const reports = [...(one.evaluations ?? []).flatMap(({ reports }) => reports), ...(one.card?.evaluation ?? [])];
    const about: [string, Node | string][] = [["Id", one.id]];
    if (one.job) about.push(["Made by", link(`jobs/${one.job}`, one.job)]);
    if (one.step != null) about.push(["Step", one.step.toLocaleString("en")]);
    if (isPolicy) about.push(["Demo", demo(`model=${one.id}`, "Try it in the demo")]);
    const files = Object.entries(one.files).map(([name, { url, bytes, blake3 }]) => [
      download(new URL(`..${url}`, location.href).href, name, bytes),
      h("code", {}, blake3.slice(0, 16)),
    ]);
    return [
      h("h1", {}, "Model"),
      facts(about),
      isPolicy &&
        section(
          "Evaluation",
          reports.length > 0 ? evaluations(reports) : h("p", { class: "hint" }, "It has not been evaluated yet."),
          h("p", {}, link(`new?kind=policy.evaluate&model_id=${one.id}`, "Evaluate it")),
        ),
      section("Files", table(["File", "BLAKE3"], files)),
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
    const show = (all: MeshRecord[]) => body.replaceChildren(all.length > 0 ? meshTable(all, refresh) : h("p", { class: "hint" }, "None yet."));
    const refresh = async () => show((await ask<List<MeshRecord>>("meshes?limit=100")).data);
    const notice = h("div");
    const input = h("input", { type: "file", accept: ".obj,.stl,.ply,.glb", "aria-label": "Mesh file" });
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
    const hint = "Meshes that the server keeps, for datasets and evaluations. What is dropped on the demo stays on your device.";
    return [h("h1", {}, "Meshes"), h("p", { class: "hint" }, hint), h("p", {}, input), notice, body];
  });
}

function meshTable(all: MeshRecord[], refresh: () => Promise<void>): HTMLElement {
  const rows = all.map(({ id, name, bytes, report }) => [
    name,
    report.extent_m.map((side) => (100 * side).toFixed(1)).join(" × ") + " cm",
    `${count(report.triangles)}, ${report.watertight ? "closed" : "open"}`,
    size(bytes),
    demo(`mesh=${id}`, "Try in demo"),
    link(`new?kind=mesh.prepare&mesh_id=${id}`, "Convex parts"),
    button("Delete", async () => {
      await ask(`meshes/${id}`, "DELETE");
      await refresh();
    }),
  ]);
  return table(["Mesh", "Size", "Triangles", "File", "", "", ""], rows);
}

