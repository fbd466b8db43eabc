// Wires the panel, the picture and the worker together. Draws and asks; knows no robotics.

import { choice, element } from "./dom";
import { Engine } from "./engine";
import { AttemptPanel } from "./panel/attempt";
import { Failures } from "./panel/failures";
import { onKeys } from "./panel/keys";
import { ObjectPicker } from "./panel/objects";
import { Playback } from "./panel/playback";
import { PosePanel } from "./panel/pose";
import { endProgress, showProgress } from "./panel/progress";
import { ReportCard } from "./panel/report";
import { makeSheet } from "./panel/sheet";
import type { FromWorker, Model, PlanarPose, ToWorker, Unit } from "./protocol";
import type { Preset } from "./view/camera";
import { type Layer, View } from "./view/view";

// The file that stands on the table, and the one that is being read.
let shownFile: File | null = null;
let comingFile: File | null = null;
let isFirstModel = true;

const engine = new Engine(receive);
const send = (message: ToWorker) => engine.send(message);
const place = (pose: PlanarPose) => send({ kind: "place", pose });

const failures = new Failures(() => engine.restart());
const attempt = new AttemptPanel({
  grasp: (seed) => send({ kind: "grasp", seed }),
  pose: (seed) => send({ kind: "randomPose", seed }),
});
const playback = new Playback(send);
const pose = new PosePanel(place);
const objects = new ObjectPicker({ load, upload });
const report = new ReportCard((unit) => shownFile && void upload(shownFile, unit));
const view = makeView();

makeSheet();
const pressCamera = choice("cameras", look);
const layers: Record<Layer, HTMLInputElement> = {
  cloud: element("layer-cloud", HTMLInputElement),
  hulls: element("layer-hulls", HTMLInputElement),
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
    ".": () => playback.step(),
    r: () => playback.reset(),
    c: () => layers.cloud.click(),
    h: () => layers.hulls.click(),
    "1": () => look("front"),
    "2": () => look("side"),
    "3": () => look("top"),
    "4": () => look("sensor"),
    "0": () => look("home"),
    "?": () => help.showModal(),
  },
  (key) => pose.nudge(key),
);

function receive(message: FromWorker): void {
  switch (message.kind) {
    case "ready":
      view?.show(message);
      objects.show(message.objects);
      pose.limit(message.workspace);
      playback.enable();
      break;
    case "object":
      view?.showObject(message);
      objects.select(message.name, message.label);
      report.show(message.report);
      attempt.hasObject(message.tally);
      if (message.name === null) shownFile = comingFile;
      break;
    case "frame":
      view?.showFrame(message);
      pose.show(message);
      attempt.showFrame(message);
      playback.show(message);
      break;
    case "cloud":
      view?.showCloud(message.points);
      break;
    case "progress":
      showProgress(message);
      break;
    case "model":
      showModel(message);
      break;
    case "verdict":
      attempt.showVerdict(message);
      break;
    case "failure":
      if (message.code.startsWith("engine_")) stop();
      failures.show(message);
      break;
  }
}

// The first attempt begins by itself, unless motion is unwelcome.
function showModel(model: Model): void {
  attempt.showModel(model);
  const isWelcome = !matchMedia("(prefers-reduced-motion: reduce)").matches;
  if (isFirstModel && isWelcome) whenSeen(() => attempt.grasp());
  isFirstModel = false;
}

function whenSeen(act: () => void): void {
  if (document.hidden) document.addEventListener("visibilitychange", act, { once: true });
  else act();
}

// Without a worker nothing can be asked for; a new one says when it is ready.
function stop(): void {
  attempt.stop();
  playback.disable();
  endProgress();
}

function load(object: string): void {
  comingFile = null;
  send({ kind: "load", object });
}

async function upload(file: File, unit: Unit | null): Promise<void> {
  comingFile = file;
  try {
    const bytes = await file.arrayBuffer();
    // Another one was chosen meanwhile.
    if (comingFile !== file) return;
    engine.send({ kind: "upload", fileName: file.name, bytes, unit }, [bytes]);
  } catch (error) {
    failures.show({
      kind: "failure",
      code: "file_unreadable",
      cause: `${file.name} could not be read: ${String(error)}`,
      cure: "Check that it still exists and may be read, and choose it again.",
    });
  }
}

// Nobody watches a hidden page.
document.addEventListener("visibilitychange", () => playback.suspend(document.hidden));

function look(preset: string): void {
  view?.look(preset as Preset);
  pressCamera(preset === "home" ? null : preset);
}

function makeView(): View | null {
  try {
    return new View(element("view", HTMLCanvasElement), {
      place,
      graphics: (works) => {
        if (works) failures.close("graphics_lost");
        else
          failures.show({
            kind: "failure",
            code: "graphics_lost",
            cause: "The browser took the graphics away.",
            cure: "They usually come back by themselves; the simulation goes on. Otherwise reload the page.",
          });
      },
    });
  } catch (error) {
    failures.show({
      kind: "failure",
      code: "graphics_missing",
      cause: `There is no WebGL here, so nothing can be drawn: ${String(error)}`,
      cure: "The simulation runs and the verdicts are told all the same. Turn on hardware acceleration, or try another browser.",
    });
    return null;
  }
}
