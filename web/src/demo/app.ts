// Demo page: connects the panels, the view and the worker.

import { choice, element } from "../common/dom";
import { showBrowserCheck } from "./browser_check";
import { Comparison } from "./comparison";
import { download } from "./download";
import { reportGlobalErrors } from "./global_errors";
import { Intro } from "./intro";
import { LiveTraining } from "./live_training";
import { AttemptPanel } from "./panel/attempt";
import { BatchPanel } from "./panel/batch";
import { initBottomSheet } from "./panel/bottom_sheet";
import { DiagnosticsPanel } from "./panel/diagnostics";
import { ErrorCards } from "./panel/error_cards";
import { GraspSearchPanel } from "./panel/grasp_search";
import { onKeys, shortcuts } from "./panel/keyboard";
import { LayerSwitches } from "./panel/layers";
import { ObjectInfoPanel } from "./panel/object_info";
import { ObjectPicker } from "./panel/object_picker";
import { Playback } from "./panel/playback";
import { PolicyPicker } from "./panel/policy";
import { PosePanel } from "./panel/pose";
import { endProgress, showProgress } from "./panel/progress";
import { SharePanel } from "./panel/share";
import type { ImportOptions, Model, PlanarPose, Ready, WorkerEvent, WorkerRequest } from "./protocol";
import { SessionState } from "./session_state";
import { parseLink, type ShareLink } from "./share_link";
import { SharedAttempt } from "./shared_attempt";
import { ATTEMPT, ERRORS, FILES, LINK } from "./strings";
import { UploadQueue } from "./upload_queue";
import { parseUrl } from "./url_params";
import type { Preset } from "./view/camera";
import { View, type ViewEvents } from "./view/view";
import { DOWNLOAD_FAILED, isFatal, loadModelRequest, WorkerClient } from "./worker_client";

// Event handlers of the second view, which only displays.
const NO_EVENTS = { place: () => {}, drag: () => {}, fellBackTo2d: () => {}, viewChanged: () => {}, userMoved: () => {} };

let isFirstModel = true;
let objectHash = "";
// Loaded policy, once the worker has reported one.
let activeModel: Model | null = null;
// Loading of the file in the URL, started with the first worker.
let urlLoad: Promise<void> | null = null;

const state = new SessionState();
const errors = new ErrorCards(restart, () => requestModel(requestedModel));
const link = parseLinkOrReport();
const params = parseUrl(link);
const worker = new WorkerClient(loadModelRequest(params.model), onEvent);
// Id of the policy that was requested last.
let requestedModel = params.model;
// Sends a request of the user or of the URL to both workers.
const send = (request: WorkerRequest) => {
  intro.onRequest(request.kind);
  uploads.afterUpload(() => {
    worker.send(request);
    comparison.send(request);
  });
};
const place = (pose: PlanarPose) => send({ kind: "place", pose });

const attempt = new AttemptPanel({
  grasp: (seed) => send({ kind: "grasp", seed }),
  placeBySeed: (seed) => send({ kind: "placeBySeed", seed }),
});
const playback = new Playback(send);
const pose = new PosePanel(place);
const objects = new ObjectPicker({
  load: loadObject,
  upload: (file) => {
    intro.onUpload();
    void uploads.start(file, optionsFor(file));
  },
  optionsRestored: (file, options) => uploads.restoreOptions(file, options),
  unreadable: (why) => errors.show({ kind: "failure", code: "files_unreadable", ...FILES.unreadableArchive(why) }),
  skipped: (max) => errors.show({ kind: "failure", code: "files_skipped", ...FILES.skipped(max) }),
  notStored: ({ name }) => errors.show({ kind: "failure", code: "mesh_not_stored", ...FILES.notStored(name) }),
});
const uploads = new UploadQueue({
  send: (request) => {
    comparison.send(request);
    worker.send(request);
  },
  meshPending: (request, file) => state.addPending(request, file),
  rejected: (file) => objects.reject(file),
  unreadable: () => objects.restoreSelection(),
  optionsChanged: (file, options) => objects.storeOptions(file, options),
  report: (failure) => errors.show(failure),
});
const info = new ObjectInfoPanel((change) => {
  const { file, newestOptions } = state;
  if (!file || !newestOptions) return;
  const options = uploads.pendingOptions(file) ?? newestOptions;
  // A new unit changes the size, so an automatic orientation is chosen again; otherwise the current one is
  // kept.
  const orientation = change.unit ? options.orientation : (options.orientation ?? state.orientation);
  void uploads.start(file, { ...options, orientation, ...change });
});
const batch = new BatchPanel({
  send,
  seed: () => attempt.seed,
  names: () => comparison.names,
  replay: (seed) => attempt.runSeed(seed),
});
const diagnostics = new DiagnosticsPanel(send);
const comparison = new Comparison({
  stateRequests: () => [...state.requests(), ...state.pending()],
  createView: () => {
    const second = makeView("view-2", { ...NO_EVENTS, contextChanged });
    layers.apply((layer, on) => second?.setLayer(layer, on));
    return second;
  },
  cameraView: () => view?.getView() ?? null,
  attemptFinished: (finished) => batch.add(finished, 1),
  batchFinished: (batchId) => batch.end(1, batchId),
  report: (failure) => errors.show(failure),
});
const policy = new PolicyPicker(params.model, (id) => {
  intro.stop();
  training?.leave();
  policy.clearLink();
  requestModel(id);
});
const training = params.training === null ? null : followTraining(params.training);
const search = new GraspSearchPanel({
  stateRequests: () => state.requests(),
  seed: () => attempt.seed,
  play: ({ grasps, objectHash }) => send({ kind: "playGrasps", seed: attempt.seed, grasps, objectHash }),
  report: (failure) => errors.show(failure),
});
const view = makeView("view", {
  place,
  // Only the first worker is dragged; the second one continues undisturbed.
  drag: (drag) => {
    intro.stop();
    worker.send({ kind: "drag", drag });
  },
  viewChanged: (numbers) => comparison.setCameraView(numbers),
  userMoved: () => pressCamera(null),
  contextChanged,
  fellBackTo2d: (why) => errors.show({ kind: "failure", code: "webgl_unavailable", ...ERRORS.webglUnavailable(why) }),
});
const share = new SharePanel({
  view: () => view?.getView() ?? null,
  screenshot: () => view?.screenshot() ?? Promise.resolve(null),
  canvas: () => element("view", HTMLCanvasElement),
  exportRecording: () => send({ kind: "exportRecording" }),
  options: () => state.options,
  file: () => state.file,
});
const sharedAttempt =
  link &&
  new SharedAttempt(link, {
    send,
    report: (failure) => errors.show(failure),
    dismiss: (code) => errors.dismiss(code),
    seek: (tick) => playback.seek(tick),
    grasp: (seed) => attempt.graspWithSeed(seed),
    confirm: () => attempt.confirmLink(),
  });

const prefersReducedMotion = matchMedia("(prefers-reduced-motion: reduce)").matches;
const intro = new Intro(!prefersReducedMotion && !sharedAttempt && !params.hasFile, {
  play: (file) => whenVisible(() => void uploads.start(file)),
  grasp: () => whenVisible(() => attempt.runSeed(0)),
});

initBottomSheet();
// A worker that is importing a mesh handles no messages, so it is replaced.
element("progress-stop", HTMLButtonElement).addEventListener("click", () => {
  abandonPending();
  stop(ATTEMPT.restarting);
  restart();
  comparison.restart();
});
element("check-open", HTMLButtonElement).addEventListener("click", showBrowserCheck);
if (new URLSearchParams(location.search).has("check")) showBrowserCheck();
const pressCamera = choice("cameras", goToPreset);
const layers = new LayerSwitches((layer, on) => {
  view?.setLayer(layer, on);
  comparison.setLayer(layer, on);
});
const help = element("help", HTMLDialogElement);
element("help-open", HTMLButtonElement).addEventListener("click", () => help.showModal());

onKeys(
  shortcuts({ attempt, playback, share, layers, help, goToPreset }),
  (key) => view?.moveByKey(key) || pose.nudge(key),
);

function onEvent(event: WorkerEvent): void {
  switch (event.kind) {
    case "ready":
      view?.show(event);
      objects.show(event.objects);
      pose.setLimits(event.workspace);
      batch.setWorkspace(event.workspace);
      playback.enable();
      diagnostics.setJoints(event.joints);
      share.ready(event);
      uploads.maxMeshBytes = event.maxMeshBytes;
      state.ready();
      if (!urlLoad) startSession(event);
      break;
    case "object":
      if (!state.objectLoaded(event)) break;
      view?.showObject(event);
      objects.select(event, state.file);
      if (state.file && state.options) uploads.loaded(state.file, state.options);
      info.show(event.info);
      attempt.hasObject(event.tally);
      if (event.hash !== objectHash) {
        batch.clear();
        search.clear();
      }
      objectHash = event.hash;
      // The second worker is given the orientation that the first policy has chosen.
      if (state.orientationReason === "chosenByModel") comparison.reorient(state.objectRequest()!);
      share.hasObject(event);
      sharedAttempt?.showObject(event);
      break;
    case "frame":
      view?.showFrame(event);
      pose.show(event);
      attempt.showFrame(event);
      training?.showFrame(event);
      playback.show(event);
      diagnostics.show(event);
      share.showFrame(event);
      state.showFrame(event);
      sharedAttempt?.showFrame(event);
      break;
    case "telemetry":
      diagnostics.showTelemetry(event);
      break;
    case "cloud":
      view?.showCloud(event);
      info.showFamiliarity(event.familiarity);
      break;
    case "progress":
      showProgress("worker", event, state.isImporting);
      break;
    case "model":
      onModel(event);
      break;
    case "outcome":
      attempt.showOutcome(event);
      share.showOutcome(event);
      intro.showOutcome(event);
      comparison.showOutcome(event);
      diagnostics.onAttemptEnd();
      sharedAttempt?.showOutcome(event);
      break;
    case "attemptFinished":
      batch.add(event, 0);
      attempt.showTally(event.tally);
      break;
    case "batchFinished":
      batch.end(0, event.batchId);
      training?.retry();
      break;
    case "file":
      download(event.name, new Blob([event.text], { type: "application/json" }));
      break;
    case "failure":
      if (isFatal(event)) {
        stop(ATTEMPT.stopped);
        // A mesh that crashed this worker would crash the next one too.
        abandonPending();
        objects.disable();
      }
      if (event.code === "wasm_unsupported") stop(ATTEMPT.unsupported);
      if (event.code === "invalid_mesh") rejectFile(state.rejected());
      // The recording of the introduction may be of another scene.
      if (event.code === "invalid_recording") intro.finishRecording();
      errors.show(event);
      break;
  }
}

// Runs once. A restarted worker continues with the session state instead.
function startSession(ready: Ready): void {
  if (link?.view) view?.setView(link.view);
  sharedAttempt?.ready(ready);
  urlLoad = loadFromUrl();
  void intro.ready();
}

// With a mesh in the URL, the first attempt starts automatically, unless the user prefers reduced motion.
async function onModel(model: Model): Promise<void> {
  attempt.showModel(model);
  // Later workers load the policy that was loaded last, not one that failed to load.
  if (model.id !== null) worker.setStartRequest(loadModelRequest(model.id));
  const hasChanged = model.id !== activeModel?.id || model.hash !== activeModel.hash;
  if (hasChanged) {
    // The reconstruction is that of the previous encoder.
    view?.clearReconstruction();
    info.showFamiliarity(null);
    batch.clear();
    share.hasModel(model);
  }
  activeModel = model;
  batch.enable(true);
  comparison.setFirst(model.id);
  policy.show(model.id);
  if (model.id === requestedModel) errors.dismiss(DOWNLOAD_FAILED);
  const isFirst = isFirstModel;
  isFirstModel = false;
  // Before attempts start with this policy, so that they use the orientation that it chooses.
  if (!isFirst && hasChanged) reorient(model);
  training?.hasModel(model);
  intro.hasModel();
  sharedAttempt?.hasModel(model.hash);
  if (isFirst) await urlLoad;
  if (isFirst) reorient(model);
  if (!isFirst || prefersReducedMotion || sharedAttempt || !params.hasFile || params.isPlayback || intro.hasUserActed) return;
  whenVisible(() => attempt.grasp());
}

// Imports a mesh again whose orientation was chosen before a policy was loaded. A pending import replaces it
// anyway.
function reorient(model: Model): void {
  const { file, options, orientationReason } = state;
  const isIdle = !uploads.isReading && !state.isImporting;
  if (model.id !== null && orientationReason === "unstable" && file && options && isIdle) void uploads.start(file, options);
}

// Loads the file in the URL; the first attempt waits for it.
async function loadFromUrl(): Promise<void> {
  try {
    const file = await params.fetchFile((progress) => showProgress("page", progress));
    if (!file) return;
    // If the user has loaded something else during the download, the file is only added to the list.
    if (intro.hasUserActed && !params.isPlayback) return objects.addIfNew(file);
    if (!params.isPlayback) objects.add(file);
    await uploads.start(file, optionsFor(file));
  } catch (error) {
    errors.show({ kind: "failure", code: "url_load_failed", ...FILES.notLoaded(String(error)) });
  }
}

// Import options of a file: those of the link, or the earlier ones.
function optionsFor(file: File): ImportOptions | undefined {
  const earlier = uploads.options(file);
  return sharedAttempt ? sharedAttempt.optionsFor(file, earlier) : earlier;
}

function contextChanged(isAvailable: boolean): void {
  if (isAvailable) errors.dismiss("graphics_lost");
  else errors.show({ kind: "failure", code: "graphics_lost", ...ERRORS.graphicsLost });
}

function whenVisible(act: () => void): void {
  if (document.hidden) document.addEventListener("visibilitychange", act, { once: true });
  else act();
}

// Disables the controls until a new worker is ready.
function stop(headline: string): void {
  intro.stop();
  attempt.stop(headline);
  batch.stop();
  batch.enable(false);
  playback.disable();
  endProgress("worker");
}

// Starts a new worker and restores the session state in it.
function restart(): void {
  uploads.cancel();
  objects.enable();
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
  return new LiveTraining(job, { load: (model) => requestModel(model, true), grasp });
}

function loadObject(object: string): void {
  uploads.cancel();
  send({ kind: "loadObject", object });
}

// Null: the file is the current object, which stays in the list.
function rejectFile(file: File | null): void {
  if (file) objects.reject(file);
}

function abandonPending(): void {
  while (state.isImporting) {
    const file = state.rejected();
    if (file) objects.abandonUpload(file);
  }
}

reportGlobalErrors(
  (failure) => errors.show(failure),
  (code) => errors.dismiss(code),
);

// A share link pasted into this tab starts as on a new page.
addEventListener("hashchange", () => parseLinkOrReport() && location.reload());

// Attempts pause while the page is hidden.
document.addEventListener("visibilitychange", () => playback.suspend(document.hidden));

function goToPreset(preset: string): void {
  view?.goTo(preset as Preset);
  pressCamera(preset === "home" ? null : preset);
}

function parseLinkOrReport(): ShareLink | null {
  try {
    return parseLink();
  } catch (error) {
    const why = error instanceof Error ? error.message : String(error);
    errors.show({ kind: "failure", code: "invalid_link", ...LINK.invalid(why) });
    return null;
  }
}

function makeView(id: string, events: ViewEvents): View | null {
  try {
    return new View(element(id, HTMLCanvasElement), events);
  } catch (error) {
    errors.show({ kind: "failure", code: "graphics_unavailable", ...ERRORS.graphicsUnavailable(String(error)) });
    return null;
  }
}
