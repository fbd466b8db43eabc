// Share link: object, pose, seed, policy, view, time and final state hash of an attempt. `ngf replay` reads
// it too.

import { MASS_LIMITS_KG } from "../../common/constants";
import { LINK } from "../app/strings";
import type { ImportOptions } from "../worker/messages";
import type { Orientation, PlanarPose, Unit, UpAxis } from "../worker/protocol";

export interface ShareLink {
  // Name of a built-in object, or of the mesh file.
  object: string;
  objectHash: string;
  // Import options of a mesh file.
  options: ImportOptions | null;
  // Id of the mesh on the server, if the user stored it there.
  mesh: string | null;
  pose: PlanarPose;
  // Whether the pose differs from the pose that the seed samples.
  placedByHand: boolean;
  seed: number;
  model: string;
  modelHash: string | null;
  sceneHash: string;
  // Camera position and orbit target; null selects the default view.
  view: number[] | null;
  // Tick to show; null is the last one.
  tick: number | null;
  finalStateHash: string;
}

const VERSION = "1";

export function buildLink(link: ShareLink, page = location.href): string {
  const { object, objectHash, options, mesh, pose, placedByHand, seed, model, modelHash, sceneHash, view, tick } = link;
  const orientation = options?.orientation;
  const fields = new URLSearchParams({
    v: VERSION,
    o: object,
    oh: objectHash,
    ...(options?.unit && { u: options.unit }),
    ...(options?.sizeM && { sz: String(options.sizeM) }),
    ...(options?.scale && { sf: String(options.scale) }),
    ...(options?.up && { up: options.up }),
    ...(options?.massKg && { kg: String(options.massKg) }),
    ...(orientation && { st: orientation === "asInFile" ? "file" : String(orientation.stablePose) }),
    p: [pose.x, pose.y, pose.yaw].join(","),
    ...(placedByHand && { d: "1" }),
    s: String(seed),
    m: model,
    ...(modelHash && { mh: modelHash }),
    sc: sceneHash,
    ...(view && { c: view.map((value) => value.toFixed(3)).join(",") }),
    ...(tick !== null && { t: String(tick) }),
    ...(mesh && { mesh }),
    h: link.finalStateHash,
  });
  const url = new URL(page);
  url.search = "";
  url.hash = fields.toString();
  return url.href;
}

// Fields that only a share link has.
const FIELDS = ["oh", "sc", "h"];

// Punctuation of the sentence around a link, which programs take for its end. Browsers escape some of it.
const PUNCTUATION = /(?:[.,;:!?)\]}>"'*»”’\s]|%22|%27|%3E|%7D|%C2%BB|%E2%80%9D|%E2%80%99)+$/i;

// Undoes the changes that mail and chat programs make to a fragment: escaped separators, "&" as "&amp;",
// punctuation at the end.
function restoreFragment(hash: string): string {
  const fragment = hash.replace(/^#?(%23)?/, "").replace(PUNCTUATION, "");
  // Separators are never escaped in a link, so all of them were, and the values twice.
  const isEscaped = !fragment.includes("=") && /%3D/i.test(fragment);
  return (isEscaped ? unescape(fragment) : fragment).replace(/&(amp;)+/g, "&");
}

function unescape(text: string): string {
  try {
    return decodeURIComponent(text);
  } catch {
    // Incomplete escapes; the missing fields are reported.
    return text;
  }
}

// Parses a URL fragment; null if it is not a share link. Throws if it is invalid.
export function parseLink(hash = location.hash): ShareLink | null {
  const fields = new URLSearchParams(restoreFragment(hash));
  const version = fields.get("v");
  if (version === null && FIELDS.some((name) => fields.has(name))) throw new Error(LINK.fieldMissing("v"));
  if (version === null) return null;
  if (version !== VERSION) throw new Error(LINK.unknownVersion(version));
  const text = (name: string) => {
    const value = fields.get(name);
    if (value === null || value === "") throw new Error(LINK.fieldMissing(name));
    return value;
  };
  const hexDigits = (name: string) => {
    const value = text(name);
    if (!/^[0-9a-f]+$/i.test(value)) throw new Error(LINK.fieldInvalid(name, value));
    return value;
  };
  const numbers = (name: string, count: number) => {
    const values = text(name).split(",").map(Number);
    if (values.length !== count || !values.every(Number.isFinite)) throw new Error(LINK.fieldNotNumbers(name, count));
    return values as [number, ...number[]];
  };
  const [x, y, yaw] = numbers("p", 3);
  return {
    object: text("o"),
    objectHash: hexDigits("oh"),
    options: {
      unit: fields.has("u") ? parseUnit(text("u")) : null,
      sizeM: fields.has("sz") ? positive("sz", numbers("sz", 1)[0]) : null,
      scale: fields.has("sf") ? positive("sf", numbers("sf", 1)[0]) : null,
      up: fields.has("up") ? parseUpAxis(text("up")) : null,
      massKg: fields.has("kg") ? parseMass("kg", numbers("kg", 1)[0]) : null,
      orientation: fields.has("st") ? parseOrientation(text("st")) : null,
    },
    mesh: fields.get("mesh"),
    pose: { x, y: y!, yaw: yaw! },
    placedByHand: fields.has("d"),
    seed: parseSeed("s", numbers("s", 1)[0]),
    model: text("m"),
    modelHash: fields.has("mh") ? hexDigits("mh") : null,
    sceneHash: hexDigits("sc"),
    view: fields.has("c") ? numbers("c", 6) : null,
    tick: fields.has("t") ? numbers("t", 1)[0] : null,
    finalStateHash: hexDigits("h"),
  };
}

const UNITS: readonly string[] = ["m", "cm", "mm", "in"] satisfies Unit[];

function parseUnit(text: string): Unit {
  if (!UNITS.includes(text)) throw new Error(LINK.fieldInvalid("u", text));
  return text as Unit;
}

const UP_AXES: readonly string[] = ["x", "y", "z"] satisfies UpAxis[];

function parseUpAxis(text: string): UpAxis {
  if (!UP_AXES.includes(text)) throw new Error(LINK.fieldInvalid("up", text));
  return text as UpAxis;
}

function positive(name: string, value: number): number {
  if (value <= 0) throw new Error(LINK.fieldInvalid(name, String(value)));
  return value;
}

function parseMass(name: string, kg: number): number {
  const [min, max] = MASS_LIMITS_KG;
  if (kg < min || kg > max) throw new Error(LINK.fieldInvalid(name, String(kg)));
  return kg;
}

function nonNegativeInteger(name: string, value: number): number {
  if (!Number.isSafeInteger(value) || value < 0) throw new Error(LINK.fieldInvalid(name, String(value)));
  return value;
}

// The worker's seeds have 32 bits.
function parseSeed(name: string, value: number): number {
  if (value > 0xffffffff) throw new Error(LINK.fieldInvalid(name, String(value)));
  return nonNegativeInteger(name, value);
}

function parseOrientation(text: string): Orientation {
  return text === "file" ? "asInFile" : { stablePose: nonNegativeInteger("st", Number(text)) };
}
