// Demo page: connects the panels, the views and the worker. A panel subscribes to the events that it shows.
// This file handles the effects on several panels, after the panels have shown the event.

import { element } from "../../common/dom";
import { download } from "../files/download";
import { AttemptPanel } from "../panel/attempt";
import { BatchPanel } from "../panel/batch";
import { initBottomSheet } from "../panel/bottom_sheet";
import { DiagnosticsPanel } from "../panel/diagnostics";
import { ErrorCards } from "../panel/error_cards";
import { GraspSearchPanel } from "../panel/grasp_search";
import { onKeys, shortcuts } from "../panel/keyboard";
import { Playback } from "../panel/playback";
import { PolicyPicker } from "../panel/policy";
import { PosePanel } from "../panel/pose";
import { endProgress, showProgress } from "../panel/progress";
import { SharePanel } from "../panel/share";
import { parseLink, type ShareLink } from "../share/share_link";
import { SharedAttempt } from "../share/shared_attempt";
import type { FailureEvent, WorkerRequest } from "../worker/messages";
import type { Drag, Model, ObjectLoaded, PlanarPose, Ready, WorkerEvent } from "../worker/protocol";
import { DOWNLOAD_FAILED, isFatal, loadModelRequest, WorkerClient } from "../worker/worker_client";
import { showBrowserCheck } from "./browser_check";
import { Comparison } from "./comparison";
import { EventBus } from "./event_bus";
import { reportGlobalErrors } from "./global_errors";
import { Intro } from "./intro";
import { LiveTraining } from "./live_training";
import { ObjectImport, SIZE_REQUIRED } from "./object_import";
import { SessionState } from "./session_state";
import { ATTEMPT, FILES, LINK } from "./strings";
import { parseUrl } from "./url_params";
import { Views } from "./views";

// Codes of failed imports.
const IMPORT_ERRORS = ["invalid_mesh", "invalid_recording", "mesh_too_large", "file_unreadable", "files_unreadable"];

const prefersReducedMotion = matchMedia("(prefers-reduced-motion: reduce)").matches;

let isFirstModel = true;
let objectHash = "";
// Loaded policy, once the worker has reported one.
let activeModel: Model | null = null;
// Loading of the file in the URL, started with the first worker.
let urlLoad: Promise<void> | null = null;

// The worker, and the state that a restart keeps.
const bus = new EventBus();
const state = new SessionState(bus);
const errors = new ErrorCards(restart, () => requestModel(requestedModel));
const report = (failure: FailureEvent) => errors.show(failure);
const link = parseLinkOrReport();
const params = parseUrl(link);
// Id of the policy that was requested last.
let requestedModel = params.model;
const worker = new WorkerClient(loadModelRequest(params.model), onWorkerEvent);

// Object and view. The callbacks run after all panels have been created.
const objects = new ObjectImport(bus, state, errors, {
  load: (object) => send({ kind: "loadObject", object }),
  send: sendNow,
  optionsFor: (file, earlier) => (sharedAttempt ? sharedAttempt.optionsFor(file, earlier) : earlier),
});
const views = new Views(bus, errors, { place, drag });
const pose = new PosePanel(bus, place);

// Attempts and their panels.
const attempt = new AttemptPanel(bus, {
  grasp: (seed) => send({ kind: "grasp", seed }),
  placeBySeed: (seed) => send({ kind: "placeBySeed", seed }),
});
const playback = new Playback(bus, send);
const diagnostics = new DiagnosticsPanel(bus, send);
const comparison = new Comparison(bus, {
  stateRequests: () => [...state.requests(), ...state.pending()],
  createView: (second) => views.createSecond(second),
  cameraView: () => views.first?.getView() ?? null,
  report,
});
new BatchPanel(bus, {
  send,
  seed: () => attempt.seed,
  names: () => comparison.names,
  replay: (seed) => attempt.runSeed(seed),
  sendInternal: (request) => worker.send(request),
  report,
});
new GraspSearchPanel(bus, {
  send: sendNow,
  hasObject: () => state.objectRequest() !== null,
  seed: () => attempt.seed,
  play: (grasps, objectHash) => send({ kind: "playGrasps", seed: attempt.seed, grasps, objectHash }),
  report,
});
const share = new SharePanel(bus, {
  view: () => views.first?.getView() ?? null,
  screenshot: () => views.first?.screenshot() ?? Promise.resolve(null),
  canvas: () => element("view", HTMLCanvasElement),
  setRecorded: (on) => views.first?.setRecorded(on),
  replay: () => {
    send({ kind: "seek", tick: 0 });
    send({ kind: "resume" });
  },
  exportRecording: () => send({ kind: "exportRecording" }),
  options: () => state.options,
  file: () => state.file,
});

// Attempts that start automatically, and the policy.
const training = params.training === null ? null : followTraining(params.training);
const sharedAttempt =
  link &&
  new SharedAttempt(bus, link, {
    send,
    report,
    dismiss: (code) => errors.dismiss(code),
    seek: (tick) => playback.seek(tick),
    grasp: (seed) => attempt.graspWithSeed(seed),
    confirm: () => attempt.confirmLink(),
  });
const intro = new Intro(bus, !prefersReducedMotion && !sharedAttempt && !params.hasFile, {
  playsRecording: !params.isModelRequested,
  play: (file) => whenVisible(() => void objects.start(file)),
  grasp: () => whenVisible(() => attempt.runSeed(0)),
  placeBySeed: () => send({ kind: "placeBySeed", seed: attempt.seed }),
});
new PolicyPicker(bus, params.model, (id) => {
  intro.stop();
  training?.leave();
  requestModel(id);
});

bus.on("ready", onReady);
bus.on("object", onObject);
bus.on("cloud", dismissImportErrors);
bus.on("model", (model) => void onModel(model));
bus.on("progress", (progress) => showProgress("worker", progress, state.isImporting));
bus.on("file", ({ name, text }) => download(name, new Blob([text], { type: "application/json" })));
bus.on("failure", onFailure);
bus.on("stopped", () => endProgress("worker"));

initBottomSheet();
// A worker that is importing a mesh handles no messages, so it is replaced.
element("progress-stop", HTMLButtonElement).addEventListener("click", () => {
  objects.abandonPending();
  stop(ATTEMPT.restarting);
  restart();
  comparison.restart();
});
element("check-open", HTMLButtonElement).addEventListener("click", showBrowserCheck);
if (new URLSearchParams(location.search).has("check")) showBrowserCheck();
const help = element("help", HTMLDialogElement);
element("help-open", HTMLButtonElement).addEventListener("click", () => help.showModal());

onKeys(
  shortcuts({ attempt, playback, share, layers: views.layers, help, goToPreset: (preset) => views.goToPreset(preset) }),
  (key) => views.first?.moveByKey(key) || pose.nudge(key),
);
reportGlobalErrors(report, (code) => errors.dismiss(code));

// A share link pasted into this tab starts as on a new page.
addEventListener("hashchange", () => parseLinkOrReport() && location.reload());

// Attempts pause while the page is hidden.
document.addEventListener("visibilitychange", () => playback.suspend(document.hidden));

function onWorkerEvent(event: WorkerEvent): void {
  // The default object of a new worker, which is about to be replaced, is not shown.
  if (event.kind === "object" && !state.objectLoaded(event)) return;
  bus.emit(event);
}

// Sends a request of the user or of the URL to both workers, after a file that is being read.
function send(request: WorkerRequest): void {
  bus.emit({ kind: "requested", request });
  objects.send(request);
}

function sendNow(request: WorkerRequest): void {
  worker.send(request);
  bus.emit({ kind: "sent", request });
}

function place(pose: PlanarPose): void {
  send({ kind: "place", pose });
}

// Only the first worker is dragged; the second one continues undisturbed.
function drag(drag: Drag | null): void {
  intro.stop();
  worker.send({ kind: "drag", drag });
}

// The session starts once. A restarted worker continues with the session state instead.
function onReady(ready: Ready): void {
  if (urlLoad) return;
  if (link?.view) views.first?.setView(link.view);
  sharedAttempt?.ready(ready);
  urlLoad = loadFromUrl();
  void intro.ready();
}

function onObject(object: ObjectLoaded): void {
  dismissImportErrors();
  if (object.hash !== objectHash) bus.emit({ kind: "objectChanged" });
  objectHash = object.hash;
  // The second worker is given the orientation that the first policy has chosen.
  if (state.orientationReason === "chosenByModel") comparison.reorient(state.objectRequest()!);
  sharedAttempt?.showObject(object);
}

// With a mesh in the URL, the first attempt starts automatically, unless the user prefers reduced motion.
async function onModel(model: Model): Promise<void> {
  // Later workers load the policy that was loaded last, not one that failed to load.
  if (model.id !== null) worker.setStartRequest(loadModelRequest(model.id));
  const hasChanged = model.id !== activeModel?.id || model.hash !== activeModel.hash;
  activeModel = model;
  if (hasChanged) bus.emit({ kind: "modelChanged", model });
  if (model.id === requestedModel) errors.dismiss(DOWNLOAD_FAILED);
  const isFirst = isFirstModel;
  isFirstModel = false;
  // Before attempts start with this policy, so that they use the orientation that it chooses.
  if (!isFirst && hasChanged) objects.reorient(model);
  training?.hasModel(model);
  intro.hasModel(model);
  sharedAttempt?.hasModel(model.hash);
  if (isFirst) await urlLoad;
  if (isFirst) objects.reorient(model);
  if (!isFirst || prefersReducedMotion || sharedAttempt || !params.hasFile || params.isPlayback || intro.hasUserActed) return;
  whenVisible(() => attempt.grasp());
}

function onFailure(failure: FailureEvent): void {
  if (isFatal(failure)) stop(ATTEMPT.stopped);
  if (failure.code === "wasm_unsupported") stop(ATTEMPT.unsupported);
  // The object import shows it with a form.
  if (failure.code !== SIZE_REQUIRED) errors.show(failure);
}

// Loads the file in the URL; the first attempt waits for it.
async function loadFromUrl(): Promise<void> {
  try {
    const file = await params.fetchFile((progress) => showProgress("page", progress));
    if (!file) return;
    // If the user has loaded something else during the download, the file is only added to the list.
    if (intro.hasUserActed && !params.isPlayback) return objects.addIfNew(file);
    if (!params.isPlayback) objects.add(file);
    await objects.start(file);
  } catch (error) {
    errors.report("url_load_failed", FILES.notLoaded(String(error)));
  }
}

// Errors about a file are obsolete once another object is on the table, or an attempt has started.
function dismissImportErrors(): void {
  for (const code of IMPORT_ERRORS) errors.dismiss(code);
}

function whenVisible(act: () => void): void {
  if (document.hidden) document.addEventListener("visibilitychange", act, { once: true });
  else act();
}

// Disables the controls until a new worker is ready.
function stop(headline: string): void {
  bus.emit({ kind: "stopped", headline });
}

// Starts a new worker and restores the session state in it.
function restart(): void {
  objects.restart();
  worker.restart();
  for (const request of state.restart()) worker.send(request);
  diagnostics.requestTelemetry();
}

function requestModel(model: string, onlyIfIdle = false): void {
  requestedModel = model;
  errors.dismiss(DOWNLOAD_FAILED);
  worker.sendOnStart(loadModelRequest(model, onlyIfIdle));
}

function followTraining(job: string): LiveTraining {
  // The attempt is repeated automatically, unless the user prefers reduced motion.
  const grasp = () => void (prefersReducedMotion || attempt.grasp());
  return new LiveTraining(bus, job, { load: (model) => requestModel(model, true), grasp });
}

function parseLinkOrReport(): ShareLink | null {
  try {
    return parseLink();
  } catch (error) {
    errors.report("invalid_link", LINK.invalid(error instanceof Error ? error.message : String(error)));
    return null;
  }
}
