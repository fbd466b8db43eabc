// Wires the panel, the picture and the worker together. Draws and asks; knows no robotics.

import { choice, element } from "../common/dom";
import { askedFor } from "./address";
import { Arrival } from "./arrival";
import { showCheck } from "./check";
import { Comparison } from "./compare";
import { Engine, useModel } from "./engine";
import { Opening } from "./opening";
import { AttemptPanel } from "./panel/attempt";
import { BatchPanel } from "./panel/batch";
import { Failures } from "./panel/failures";
import { InsidePanel } from "./panel/inside";
import { onKeys } from "./panel/keys";
import { ObjectPicker } from "./panel/objects";
import { Playback } from "./panel/playback";
import { PosePanel } from "./panel/pose";
import { endProgress, showProgress } from "./panel/progress";
import { ReportCard } from "./panel/report";
import { SearchPanel } from "./panel/search";
import { SharePanel } from "./panel/share";
import { makeSheet } from "./panel/sheet";
import type { FromWorker, Model, PlanarPose, Told, ToWorker } from "./protocol";
import { save } from "./save";
import { type Shared, sharedIn } from "./share";
import { FAILURES, FILES, LINK } from "./strings";
import type { Preset } from "./view/camera";
import { type Layer, View } from "./view/view";

// The file that stands on the table, and the one that is being read.
let shownFile: File | null = null;
let comingFile: File | null = null;
let isFirstModel = true;
// What stands on the table, as a worker is told, and where.
let standing: ToWorker | null = null;
let placed: PlanarPose | null = null;
let objectHash = "";
let mostBytes = Infinity;
let brought: Promise<void> = Promise.resolve();

const failures = new Failures(() => {
  engine.restart();
  // What stood there stands there again.
  for (const message of now()) engine.send(message);
});
const shared = sharedOrTold();
const asked = askedFor(shared);
const engine = new Engine(useModel(asked.model), receive);
// What somebody asks for, as the page was opened or since.
const send = (message: ToWorker) => {
  if (!PASSIVE.has(message.kind)) opening.stop();
  engine.send(message);
  comparison.send(message);
};
const PASSIVE = new Set<ToWorker["kind"]>(["watch", "pause", "resume", "speed"]);
const place = (pose: PlanarPose) => send({ kind: "place", pose });

const attempt = new AttemptPanel({
  grasp: (seed) => send({ kind: "grasp", seed }),
  pose: (seed) => send({ kind: "randomPose", seed }),
});
const playback = new Playback(send);
const pose = new PosePanel(place);
const objects = new ObjectPicker({
  load,
  upload: (file) => {
    opening.stop();
    void upload(file, report.begin(arrival?.told));
  },
  refused: (cause) => failures.show({ kind: "failure", code: "files_unreadable", ...FILES.unusable(cause) }),
});
const report = new ReportCard((told) => shownFile && void upload(shownFile, told));
const batch = new BatchPanel({
  send,
  seed: () => attempt.seed,
  replay: (seed) => attempt.show(seed),
});
const inside = new InsidePanel(send);
const comparison = new Comparison({
  now,
  tell: (failure) => failures.show(failure),
});
const search = new SearchPanel({
  now,
  seed: () => attempt.seed,
  follow: (grasps) => send({ kind: "follow", seed: attempt.seed, grasps }),
  tell: (failure) => failures.show(failure),
});
const view = makeView();
const share = new SharePanel({
  view: () => view?.stand() ?? [0, 0, 0, 0, 0, 0],
  picture: () => view?.picture() ?? Promise.resolve(null),
  canvas: () => element("view", HTMLCanvasElement),
  episode: () => send({ kind: "export" }),
  told: () => (shownFile ? report.told : null),
  file: () => shownFile,
});
const arrival =
  shared &&
  new Arrival(shared, {
    send,
    tell: (failure) => failures.show(failure),
    untell: (code) => failures.close(code),
    seek: (tick) => playback.seek(tick),
    grasp: (seed) => attempt.tryAgain(seed),
    agrees: () => attempt.confirm(),
  });

const isCalm = matchMedia("(prefers-reduced-motion: reduce)").matches;
const opening = new Opening(!isCalm && !arrival && !asked.brings, {
  play: (file) => whenSeen(() => void upload(file)),
  grasp: () => whenSeen(() => attempt.show(0)),
});

makeSheet();
element("check-open", HTMLButtonElement).addEventListener("click", showCheck);
if (new URLSearchParams(location.search).has("check")) showCheck();
const pressCamera = choice("cameras", look);
const layers: Record<Layer, HTMLInputElement> = {
  cloud: element("layer-cloud", HTMLInputElement),
  reconstruction: element("layer-reconstruction", HTMLInputElement),
  hulls: element("layer-hulls", HTMLInputElement),
  forces: element("layer-forces", HTMLInputElement),
  trail: element("layer-trail", HTMLInputElement),
  target: element("layer-target", HTMLInputElement),
  sensor: element("layer-sensor", HTMLInputElement),
};
for (const [layer, input] of Object.entries(layers)) {
  input.addEventListener("change", () => view?.setLayer(layer as Layer, input.checked));
}
const help = element("help", HTMLDialogElement);
element("help-open", HTMLButtonElement).addEventListener("click", () => help.showModal());

onKeys(
  {
    g: () => attempt.grasp(),
    n: () => attempt.newPose(),
    " ": () => playback.toggle(),
    ",": () => playback.back(),
    ".": () => playback.step(),
    l: () => void share.copy(),
    i: () => element("inside", HTMLDetailsElement).querySelector("summary")?.click(),
    r: () => playback.reset(),
    c: () => layers.cloud.click(),
    m: () => layers.reconstruction.click(),
    h: () => layers.hulls.click(),
    f: () => layers.forces.click(),
    t: () => layers.trail.click(),
    j: () => layers.target.click(),
    s: () => layers.sensor.click(),
    "1": () => look("front"),
    "2": () => look("side"),
    "3": () => look("top"),
    "4": () => look("sensor"),
    "0": () => look("home"),
    "?": () => help.showModal(),
  },
  (key) => pose.nudge(key),
);

// What a new worker must be told to stand where this one does; bytes go to one worker only.
function now(): ToWorker[] {
  const object = standing?.kind === "upload" ? { ...standing, bytes: standing.bytes.slice(0) } : standing;
  return [...(object ? [object] : []), ...(placed ? [{ kind: "place", pose: placed } as const] : [])];
}

function receive(message: FromWorker): void {
  switch (message.kind) {
    case "ready":
      view?.show(message);
      objects.show(message.objects);
      pose.limit(message.workspace);
      playback.enable();
      inside.limit(message.joints);
      share.ready(message);
      mostBytes = message.mostBytes;
      if (shared) view?.standAt(shared.view);
      arrival?.ready(message);
      brought = bring();
      void opening.ready();
      break;
    case "object":
      view?.showObject(message);
      objects.select(message);
      if (message.name !== null) standing = { kind: "load", object: message.name };
      report.show(message.report);
      attempt.hasObject(message.tally);
      batch.clear();
      if (message.hash !== objectHash) search.clear();
      objectHash = message.hash;
      share.hasObject(message);
      arrival?.showObject(message);
      if (message.name === null) shownFile = comingFile;
      break;
    case "frame":
      view?.showFrame(message);
      pose.show(message);
      attempt.showFrame(message);
      playback.show(message);
      inside.show(message);
      share.show(message);
      placed = message.pose;
      arrival?.showFrame(message);
      break;
    case "cloud":
      view?.showCloud(message);
      report.showLikeness(message.likeness);
      break;
    case "progress":
      showProgress(message);
      break;
    case "model":
      showModel(message);
      break;
    case "verdict":
      attempt.showVerdict(message);
      share.showVerdict(message);
      opening.showVerdict(message);
      comparison.showVerdict(message);
      arrival?.showVerdict(message);
      break;
    case "attempted":
      batch.add(message);
      attempt.showTally(message.tally);
      break;
    case "batchOver":
      batch.end();
      break;
    case "file":
      save(message.name, new Blob([message.text], { type: "application/json" }));
      break;
    case "failure":
      if (message.code.startsWith("engine_")) stop();
      if (message.code === "mesh_unusable" && comingFile) objects.refuse(comingFile.name);
      failures.show(message);
      break;
  }
}

// With a mesh that the address asks for, the first attempt begins by itself, unless motion is unwelcome.
async function showModel(model: Model): Promise<void> {
  attempt.showModel(model);
  batch.clear();
  batch.enable(true);
  share.hasModel(model);
  comparison.name(model.id);
  arrival?.hasModel(model.hash);
  opening.hasModel();
  const isFirst = isFirstModel;
  isFirstModel = false;
  if (!isFirst || isCalm || !asked.brings || asked.plays) return;
  await brought;
  whenSeen(() => attempt.grasp());
}

// What the address asks for comes first, and is what the first attempt is about.
async function bring(): Promise<void> {
  try {
    const file = await asked.fetchFile();
    if (!file) return;
    if (!asked.plays) objects.add(file);
    await upload(file, report.begin(arrival?.told));
  } catch (error) {
    failures.show({ kind: "failure", code: "address_unusable", ...FILES.notFetched(String(error)) });
  }
}

function whenSeen(act: () => void): void {
  if (document.hidden) document.addEventListener("visibilitychange", act, { once: true });
  else act();
}

// Without a worker nothing can be asked for; a new one says when it is ready.
function stop(): void {
  attempt.stop();
  batch.clear();
  batch.enable(false);
  playback.disable();
  endProgress();
}

function load(object: string): void {
  comingFile = null;
  standing = { kind: "load", object };
  send(standing);
}

async function upload(file: File, told: Told = { unit: null, massKg: null, stands: null }): Promise<void> {
  // What would not be taken is not even read.
  if (file.size > mostBytes) {
    objects.refuse(file.name);
    const told = FILES.tooLarge(file.name, (file.size / 1e6).toFixed(0), mostBytes / 1e6);
    failures.show({ kind: "failure", code: "mesh_too_large", ...told });
    return;
  }
  comingFile = file;
  try {
    const bytes = await file.arrayBuffer();
    // Another one was chosen meanwhile.
    if (comingFile !== file) return;
    const message = { kind: "upload", fileName: file.name, bytes, ...told } as const;
    comparison.send(message);
    standing = { ...message, bytes: bytes.slice(0) };
    engine.send(message, [bytes]);
  } catch (error) {
    failures.show({ kind: "failure", code: "file_unreadable", ...FILES.unreadable(file.name, String(error)) });
  }
}

// Nobody watches a hidden page.
document.addEventListener("visibilitychange", () => playback.suspend(document.hidden));

function look(preset: string): void {
  view?.look(preset as Preset);
  pressCamera(preset === "home" ? null : preset);
}

// The attempt that the address is of, if it is of one.
function sharedOrTold(): Shared | null {
  try {
    return sharedIn();
  } catch (error) {
    const why = error instanceof Error ? error.message : String(error);
    failures.show({ kind: "failure", code: "link_damaged", ...LINK.damaged(why) });
    return null;
  }
}

function makeView(): View | null {
  try {
    return new View(element("view", HTMLCanvasElement), {
      place,
      // The second picture, if there is one, goes on by itself.
      pull: (pull) => {
        opening.stop();
        engine.send({ kind: "pull", pull });
      },
      moved: (stand) => comparison.stand(stand),
      graphics: (works) => {
        if (works) failures.close("graphics_lost");
        else failures.show({ kind: "failure", code: "graphics_lost", ...FAILURES.graphicsLost });
      },
    });
  } catch (error) {
    failures.show({ kind: "failure", code: "graphics_missing", ...FAILURES.graphicsMissing(String(error)) });
    return null;
  }
}
