// Wires the panel, the picture and the worker together. Draws and asks; knows no robotics.

import { choice, element } from "../common/dom";
import { askedFor } from "./address";
import { Arrival } from "./arrival";
import { showCheck } from "./check";
import { Comparison } from "./compare";
import { Engine, isEnd, NOT_FETCHED, useModel } from "./engine";
import { Opening } from "./opening";
import { AttemptPanel } from "./panel/attempt";
import { BatchPanel } from "./panel/batch";
import { Failures } from "./panel/failures";
import { InsidePanel } from "./panel/inside";
import { onKeys } from "./panel/keys";
import { LayerSwitches } from "./panel/layers";
import { ObjectPicker } from "./panel/objects";
import { Playback } from "./panel/playback";
import { PolicyPicker } from "./panel/policy";
import { PosePanel } from "./panel/pose";
import { endProgress, showProgress } from "./panel/progress";
import { ReportCard } from "./panel/report";
import { SearchPanel } from "./panel/search";
import { SharePanel } from "./panel/share";
import { shortcuts } from "./panel/shortcuts";
import { makeSheet } from "./panel/sheet";
import type { FromWorker, Model, PlanarPose, Ready, Told, ToWorker } from "./protocol";
import { save } from "./save";
import { type Shared, sharedIn } from "./share";
import { Situation } from "./situation";
import { ATTEMPT, FAILURES, FILES, LINK } from "./strings";
import { Training } from "./training";
import { Uploads } from "./uploads";
import type { Preset } from "./view/camera";
import { View, type ViewEvents } from "./view/view";
import { watch } from "./watch";

// What the second picture has to say: nothing.
const ALONE = { place: () => {}, pull: () => {}, sketched: () => {}, moved: () => {}, taken: () => {} };

let isFirstModel = true;
let objectHash = "";
// Who acts, once somebody does.
let acts: Model | null = null;
// What the address asks for, once a worker is there.
let brought: Promise<void> | null = null;

const situation = new Situation();
const failures = new Failures(restart, () => use(wanted));
const shared = sharedOrTold();
const asked = askedFor(shared);
const engine = new Engine(useModel(asked.model), receive);
// The policy that was asked for last.
let wanted = asked.model;
// What somebody asks for, as the page was opened or since.
const send = (message: ToWorker) => {
  opening.asked(message.kind);
  uploads.after(() => {
    engine.send(message);
    comparison.send(message);
  });
};
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
    opening.brought();
    void uploads.begin(file, saidOf(file));
  },
  corrected: (file, told) => uploads.remember(file, told),
  refused: (cause) => failures.show({ kind: "failure", code: "files_unreadable", ...FILES.unusable(cause) }),
  cut: (most) => failures.show({ kind: "failure", code: "files_left_out", ...FILES.cut(most) }),
  unkept: ({ name }) => failures.show({ kind: "failure", code: "mesh_not_kept", ...FILES.notKept(name) }),
});
const uploads = new Uploads({
  read: (message) => {
    comparison.send(message);
    engine.send(message);
  },
  asked: (message, file) => situation.ask(message, file),
  refused: (file) => objects.refuse(file),
  unread: () => objects.stay(),
  corrected: (file, told) => objects.correct(file, told),
  tell: (failure) => failures.show(failure),
});
const report = new ReportCard((part) => {
  const { file, lastTold } = situation;
  if (!file || !lastTold) return;
  const told = uploads.awaited(file) ?? lastTold;
  // In another unit it looks otherwise, and what was guessed is guessed anew; else it stays as it is.
  const stands = part.unit ? told.stands : (told.stands ?? situation.stands);
  void uploads.begin(file, { ...told, stands, ...part });
});
const batch = new BatchPanel({
  send,
  seed: () => attempt.seed,
  names: () => comparison.names,
  replay: (seed) => attempt.show(seed),
});
const inside = new InsidePanel(send);
const comparison = new Comparison({
  now: () => [...situation.now(), ...situation.coming()],
  picture: () => {
    const picture = makeView("view-2", { ...ALONE, graphics });
    layers.apply((layer, on) => picture?.setLayer(layer, on));
    return picture;
  },
  stand: () => view?.stand() ?? null,
  attempted: (row) => batch.add(row, 1),
  over: (run) => batch.end(1, run),
  tell: (failure) => failures.show(failure),
});
const policy = new PolicyPicker(asked.model, (id) => {
  opening.stop();
  training?.leave();
  policy.leaveLink();
  use(id);
});
const training = asked.training === null ? null : follow(asked.training);
const search = new SearchPanel({
  now: () => situation.now(),
  seed: () => attempt.seed,
  follow: ({ grasps, object }) => send({ kind: "follow", seed: attempt.seed, grasps, object }),
  tell: (failure) => failures.show(failure),
});
const view = makeView("view", {
  place,
  // The second picture, if there is one, goes on by itself.
  pull: (pull) => {
    opening.stop();
    engine.send({ kind: "pull", pull });
  },
  moved: (stand) => comparison.stand(stand),
  taken: () => pressCamera(null),
  graphics,
  sketched: (why) => failures.show({ kind: "failure", code: "graphics_flat", ...FAILURES.graphicsFlat(why) }),
});
const share = new SharePanel({
  view: () => view?.stand() ?? null,
  picture: () => view?.picture() ?? Promise.resolve(null),
  canvas: () => element("view", HTMLCanvasElement),
  episode: () => send({ kind: "export" }),
  told: () => situation.told,
  file: () => situation.file,
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
  play: (file) => whenSeen(() => void uploads.begin(file)),
  grasp: () => whenSeen(() => attempt.show(0)),
});

makeSheet();
// A worker that reads hears nothing: another one takes its place.
element("progress-stop", HTMLButtonElement).addEventListener("click", () => {
  while (situation.isReading) giveUp(situation.refused());
  stop(ATTEMPT.restarting);
  restart();
  comparison.restart();
});
element("check-open", HTMLButtonElement).addEventListener("click", showCheck);
if (new URLSearchParams(location.search).has("check")) showCheck();
const pressCamera = choice("cameras", look);
const layers = new LayerSwitches((layer, on) => {
  view?.setLayer(layer, on);
  comparison.setLayer(layer, on);
});
const help = element("help", HTMLDialogElement);
element("help-open", HTMLButtonElement).addEventListener("click", () => help.showModal());

onKeys(
  shortcuts({ attempt, playback, share, layers, help, look }),
  (key) => view?.step(key) || pose.nudge(key),
);

function receive(message: FromWorker): void {
  switch (message.kind) {
    case "ready":
      view?.show(message);
      objects.show(message.objects);
      pose.limit(message.workspace);
      batch.limit(message.workspace);
      playback.enable();
      inside.limit(message.joints);
      share.ready(message);
      uploads.mostBytes = message.mostBytes;
      situation.ready();
      if (!brought) begin(message);
      break;
    case "object":
      if (!situation.loaded(message)) break;
      view?.showObject(message);
      objects.select(message, situation.file);
      if (situation.file && situation.told) uploads.loaded(situation.file, situation.told);
      report.show(message.report);
      attempt.hasObject(message.tally);
      if (message.hash !== objectHash) {
        batch.clear();
        search.clear();
      }
      objectHash = message.hash;
      // The second worker was not asked how it lies.
      if (situation.because === "laid") comparison.lay(situation.object()!);
      share.hasObject(message);
      arrival?.showObject(message);
      break;
    case "frame":
      view?.showFrame(message);
      pose.show(message);
      attempt.showFrame(message);
      training?.showFrame(message);
      playback.show(message);
      inside.show(message);
      share.show(message);
      situation.show(message);
      arrival?.showFrame(message);
      break;
    case "course":
      inside.showCourse(message);
      break;
    case "cloud":
      view?.showCloud(message);
      report.showLikeness(message.likeness);
      break;
    case "progress":
      showProgress("worker", message, situation.isReading);
      break;
    case "model":
      showModel(message);
      break;
    case "verdict":
      attempt.showVerdict(message);
      share.showVerdict(message);
      opening.showVerdict(message);
      comparison.showVerdict(message);
      inside.end();
      arrival?.showVerdict(message);
      break;
    case "attempted":
      batch.add(message, 0);
      attempt.showTally(message.tally);
      break;
    case "batchOver":
      batch.end(0, message.run);
      training?.tryAgain();
      break;
    case "file":
      save(message.name, new Blob([message.text], { type: "application/json" }));
      break;
    case "failure":
      if (isEnd(message)) {
        stop(ATTEMPT.stopped);
        // What it could not read would stop the next one, too.
        while (situation.isReading) giveUp(situation.refused());
        objects.disable();
      }
      if (message.code === "wasm_unsupported") stop(ATTEMPT.unsupported);
      if (message.code === "mesh_unusable") refuse(situation.refused());
      // The recording may be of another scene.
      if (message.code === "recording_unusable") opening.end();
      failures.show(message);
      break;
  }
}

// Once: a worker that is begun anew goes on where the last one stopped.
function begin(ready: Ready): void {
  if (shared?.view) view?.standAt(shared.view);
  arrival?.ready(ready);
  brought = bring();
  void opening.ready();
}

// With a mesh that the address asks for, the first attempt begins by itself, unless motion is unwelcome.
async function showModel(model: Model): Promise<void> {
  attempt.showModel(model);
  // Of what was asked for and did not come, a later worker is not told.
  if (model.id !== null) engine.keep(useModel(model.id));
  const isOther = model.id !== acts?.id || model.hash !== acts.hash;
  if (isOther) {
    // What another encoder made of the cloud is not what this one does.
    view?.forgetReconstruction();
    report.showLikeness(null);
    batch.clear();
    share.hasModel(model);
  }
  acts = model;
  batch.enable(true);
  comparison.name(model.id);
  policy.show(model.id);
  if (model.id === wanted) failures.close(NOT_FETCHED);
  const isFirst = isFirstModel;
  isFirstModel = false;
  // What begins with this policy begins when it lies as this one has it.
  if (!isFirst && isOther) layAgain(model);
  training?.hasModel(model);
  opening.hasModel();
  arrival?.hasModel(model.hash);
  if (isFirst) await brought;
  if (isFirst) layAgain(model);
  if (!isFirst || isCalm || arrival || !asked.brings || asked.plays || opening.isBegun) return;
  whenSeen(() => attempt.grasp());
}

// A mesh was laid down by itself, before this policy could be asked; what was chosen since comes anyway.
function layAgain(model: Model): void {
  const { file, told, because } = situation;
  const isAlone = !uploads.isAwaiting && !situation.isReading;
  if (model.id !== null && because === "wouldFall" && file && told && isAlone) void uploads.begin(file, told);
}

// What the address asks for comes first, and is what the first attempt is about.
async function bring(): Promise<void> {
  try {
    const file = await asked.fetchFile((progress) => showProgress("page", progress));
    if (!file) return;
    // Whoever has begun something else meanwhile finds it in the list.
    if (opening.isBegun && !asked.plays) return objects.offer(file);
    if (!asked.plays) objects.add(file);
    await uploads.begin(file, saidOf(file));
  } catch (error) {
    failures.show({ kind: "failure", code: "address_unusable", ...FILES.notFetched(String(error)) });
  }
}

// What is said of a file as it is read.
function saidOf(file: File): Told | undefined {
  const before = uploads.told(file);
  return arrival ? arrival.told(file, before) : before;
}

function graphics(works: boolean): void {
  if (works) failures.close("graphics_lost");
  else failures.show({ kind: "failure", code: "graphics_lost", ...FAILURES.graphicsLost });
}

function whenSeen(act: () => void): void {
  if (document.hidden) document.addEventListener("visibilitychange", act, { once: true });
  else act();
}

// Without a worker nothing can be asked for; a new one says when it is ready.
function stop(headline: string): void {
  opening.stop();
  attempt.stop(headline);
  batch.stop();
  batch.enable(false);
  playback.disable();
  endProgress("worker");
}

// Another worker, in which stands what stood there.
function restart(): void {
  uploads.forget();
  objects.enable();
  engine.restart();
  for (const message of situation.restart()) engine.send(message);
  inside.ask();
}

function use(model: string, gently = false): void {
  wanted = model;
  failures.close(NOT_FETCHED);
  engine.greet(useModel(model, gently));
}

function follow(job: string): Training {
  // The attempt begins again by itself, unless motion is unwelcome.
  const grasp = () => void (isCalm || attempt.grasp());
  return new Training(job, { use: (model) => use(model, true), grasp });
}

function load(object: string): void {
  uploads.forget();
  send({ kind: "load", object });
}

// What stands on the table keeps its place in the list.
function refuse(file: File | null): void {
  if (file) objects.refuse(file);
}

// The same of one that nobody waits for any more.
function giveUp(file: File | null): void {
  if (file) objects.giveUp(file);
}

watch(
  (failure) => failures.show(failure),
  (code) => failures.close(code),
);

// A link that is followed here begins as on a page of its own.
addEventListener("hashchange", () => sharedOrTold() && location.reload());

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

function makeView(id: string, events: ViewEvents): View | null {
  try {
    return new View(element(id, HTMLCanvasElement), events);
  } catch (error) {
    failures.show({ kind: "failure", code: "graphics_missing", ...FAILURES.graphicsMissing(String(error)) });
    return null;
  }
}
