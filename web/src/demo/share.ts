// A link that brings somebody else to the same attempt: object, pose, seed, policy, view, moment, and how it ended.

import type { PlanarPose, Stands, Told, Unit } from "./protocol";
import { LINK } from "./strings";

export interface Shared {
  // Name of a built-in object, or of the file.
  object: string;
  objectHash: string;
  // What was said of the file, if it is one.
  told: Told | null;
  // Id of the mesh on the server, if it was stored there on purpose.
  mesh: string | null;
  pose: PlanarPose;
  // Whether it was placed by hand, not where the seed puts it.
  placed: boolean;
  seed: number;
  model: string;
  modelHash: string | null;
  scene: string;
  // Position of the viewer and of what is looked at; null is where the page begins.
  view: number[] | null;
  // The moment to stop at; null is the end.
  tick: number | null;
  // Of the final state.
  end: string;
}

const VERSION = "1";

export function linkOf(shared: Shared, page = location.href): string {
  const { object, objectHash, told, mesh, pose, placed, seed, model, modelHash, scene, view, tick, end } = shared;
  const fields = new URLSearchParams({
    v: VERSION,
    o: object,
    oh: objectHash,
    ...(told?.unit && { u: told.unit }),
    ...(told?.massKg && { kg: String(told.massKg) }),
    ...(told?.stands && { st: told.stands === "asInFile" ? "file" : String(told.stands.on) }),
    p: [pose.x, pose.y, pose.yaw].join(","),
    ...(placed && { d: "1" }),
    s: String(seed),
    m: model,
    ...(modelHash && { mh: modelHash }),
    sc: scene,
    ...(view && { c: view.map((value) => value.toFixed(3)).join(",") }),
    ...(tick !== null && { t: String(tick) }),
    ...(mesh && { mesh }),
    h: end,
  });
  const url = new URL(page);
  url.search = "";
  url.hash = fields.toString();
  return url.href;
}

// What the fragment of an address says; null if it is none of ours. Throws where it is damaged.
export function sharedIn(hash = location.hash): Shared | null {
  const fields = new URLSearchParams(hash.slice(1));
  const version = fields.get("v");
  if (version === null) return null;
  if (version !== VERSION) throw new Error(LINK.unknownVersion(version));
  const text = (name: string) => {
    const value = fields.get(name);
    if (value === null || value === "") throw new Error(LINK.partMissing(name));
    return value;
  };
  const numbers = (name: string, count: number) => {
    const values = text(name).split(",").map(Number);
    if (values.length !== count || !values.every(Number.isFinite)) throw new Error(LINK.partNotNumbers(name, count));
    return values as [number, ...number[]];
  };
  const [x, y, yaw] = numbers("p", 3);
  return {
    object: text("o"),
    objectHash: text("oh"),
    told: {
      unit: fields.has("u") ? unitIn(text("u")) : null,
      massKg: fields.has("kg") ? positiveIn("kg", numbers("kg", 1)[0]) : null,
      stands: fields.has("st") ? standsIn(text("st")) : null,
    },
    mesh: fields.get("mesh"),
    pose: { x, y: y!, yaw: yaw! },
    placed: fields.has("d"),
    seed: seedIn("s", numbers("s", 1)[0]),
    model: text("m"),
    modelHash: fields.get("mh"),
    scene: text("sc"),
    view: fields.has("c") ? numbers("c", 6) : null,
    tick: fields.has("t") ? numbers("t", 1)[0] : null,
    end: text("h"),
  };
}

const UNITS: readonly string[] = ["m", "cm", "mm", "in"] satisfies Unit[];

function unitIn(text: string): Unit {
  if (!UNITS.includes(text)) throw new Error(LINK.partUnknown("u", text));
  return text as Unit;
}

function positiveIn(name: string, value: number): number {
  if (value <= 0) throw new Error(LINK.partUnknown(name, String(value)));
  return value;
}

function countIn(name: string, value: number): number {
  if (!Number.isSafeInteger(value) || value < 0) throw new Error(LINK.partUnknown(name, String(value)));
  return value;
}

// The worker's seeds have 32 bits.
function seedIn(name: string, value: number): number {
  if (value > 0xffffffff) throw new Error(LINK.partUnknown(name, String(value)));
  return countIn(name, value);
}

function standsIn(text: string): Stands {
  return text === "file" ? "asInFile" : { on: countIn("st", Number(text)) };
}
