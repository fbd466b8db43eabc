// Texts of the demo page. Static text is in index.html; the worker generates the texts about objects and
// attempts.

import { MESH_FORMATS } from "../../common/constants";
import type { Tally } from "../worker/protocol";

export const ATTEMPT = {
  phases: {
    idle: "Drag the object, or press Grasp.",
    approach: "Moving to the pre-grasp pose",
    lift: "Lifting",
    hold: "Holding for two seconds",
  },
  policy: "Policy",
  planner: "Planner",
  grasping: (actor: "policy" | "planner") => `${actor === "policy" ? "Policy" : "Planner"}: grasping`,
  stopped: "Stopped",
  restarting: "Restarting…",
  unsupported: "This browser is not supported",
  seed: (seed: number) => `Seed ${seed}`,
  invalidSeed: "A seed is a whole number from 0 to 4294967295.",
  customPose: ", custom pose",
  noPolicy: (playback: string) => `${playback} (no policy)`,
  finalState: (attempt: string, hash: string) => `${attempt}. Final state: ${hash}`,
  disturbed: "You moved the object during this attempt, so it is not counted.",
  // The simulation continues for a second after a failure.
  settling: "The last second is not counted.",
  matchesLink: (note: string | null) => `${note} (matches the link)`,
  matchesRecording: (note: string | null) => `${note} (matches the recording)`,
  differsFromRecording: (note: string | null) => `${note} (differs from the recording)`,
} as const;

export const TALLY = {
  none: "No attempts with this object yet",
  hint: "The seed determines the object pose, camera noise and pre-grasp target.",
  lifted: ({ lifted, attempts }: Tally) => `${lifted} of ${attempts} lifted`,
  interval: (min: string, max: string) => `95 % confidence interval: ${min} to ${max}. Repeated seeds count once.`,
} as const;

export const BATCH = {
  run: "Run",
  stop: "Stop",
  outcome: (seed: number, text: string) => `Seed ${seed}: ${text}`,
  replay: "Replay",
  replaySeed: (seed: number) => `Replay seed ${seed}`,
  aborted: "The batch was stopped; its results so far are kept. Run it again.",
  ofPolicy: (name: string, text: string) => `${name}: ${text}`,
  interval: (lifted: string, min: string, max: string) => `${lifted} (${min} to ${max})`,
  paired: (first: string, a: number, second: string, b: number, both: number) =>
    `Paired (${both} seeds): ${a} lifted only by ${first}, ${b} only by ${second}.`,
} as const;

export const PLAYBACK = {
  pause: "Pause",
  resume: "Resume",
  paused: "Paused",
  rate: (factor: string) => `${factor}× real time`,
  time: (time: string, total: string) => `${time} of ${total} seconds`,
  afterOutcome: (time: string) => `+${time} s`,
  afterOutcomeText: (time: string) => `${time} seconds after the outcome, not counted`,
} as const;

export const OBJECT_INFO = {
  mesh: (triangles: string, watertight: boolean, parts: number) =>
    `${triangles} triangles, ${watertight ? "watertight" : "open"}, ${parts} convex ${parts === 1 ? "part" : "parts"}`,
  asInFile: "As in file",
  mostStable: "Most stable",
  face: (number: number) => `Face ${number}`,
} as const;

export const SIZE_FORM = {
  length: "Longest side",
  unit: "Unit of length",
  use: "Use this size",
} as const;

export const COMPARISON = {
  planner: "planner",
  loading: (policy: string) => `${policy}: loading`,
  second: (policy: string) => `${policy} (2)`,
  closed: "The comparison was closed; the attempt of the first policy continues. To compare again, reselect the second policy.",
} as const;

export const TRAINING = {
  usingLatest: (step: string) => `Using the latest checkpoint, step ${step}.`,
  latest: (step: string, used?: string | 0) => `${used ? `Using the checkpoint of step ${used}. ` : ""}Latest checkpoint: step ${step}.`,
  finished: "Training finished.",
  lost: "Server not reachable. New checkpoints will load when it is back.",
} as const;

export const SEARCH = {
  hint: "Sampling-based search in simulation. Works with any mesh and needs no policy.",
  start: "Search for a grasp",
  starting: "Starting…",
  stop: "Stop",
  stopped: "Stopped.",
  progress: (tried: number, robust: number, rate: number, left: string) =>
    `${tried} grasps tried (${rate.toFixed(1)}/s), ${robust} robust` + (left && `, about ${left} left`),
  found: (tried: number, selected: number, isLong: boolean) => {
    if (selected > 0) return `${tried} grasps tried, ${selected} selected. Play each of them:`;
    const advice = isLong ? "" : tried > 0 ? " A longer search tries more." : " All were out of reach; a longer search samples more.";
    return `${tried} grasps tried, none robust.${advice}`;
  },
  play: (number: number) => `Play grasp ${number}`,
  aborted: "The search was aborted; the attempt continues. Search again, or use a simpler mesh.",
} as const;

export const SHARE = {
  hint: "Opens this exact attempt on another computer, with the same result.",
  noPolicy: "No link available: only attempts of a policy can be reproduced.",
  disturbed: "No link available: your interaction with the object cannot be reproduced.",
  copied: "Copied.",
  copiedWithoutFile: "Copied. Recipients also need the mesh file.",
  uploading: (file: string) => `Uploading ${file}…`,
  cancelUpload: "Cancel upload",
  uploadCancelled: "Upload cancelled.",
  stored: "Mesh stored on the server; the link now includes it.",
  notStored: (why: string) => `The mesh was not stored on the server: ${why}.`,
  tooLarge: (file: string, max: number) => `${file} is larger than ${max} MB`,
  noServer: "no server reachable",
  video: "Video",
  stop: "Stop",
  noVideo: (why: string) => `No video was recorded: ${why}`,
  noFrames: "the browser delivered no frames. Keep the page visible, or use a screen recorder.",
} as const;

export const DIAGNOSTICS = {
  groups: { arm: "Arm", index: "Index", middle: "Middle", ring: "Ring", thumb: "Thumb" },
  position: (q: string, lower: string, upper: string) => `${q} rad (limits ${lower} to ${upper})`,
  noValue: "n/a",
  seconds: (time: string) => `${time} s`,
  plots: {
    energy: { name: "Energy ½ q̇ᵀq̇", unit: "rad²/s²" },
    terms: {
      name: "Acceleration terms",
      unit: "rad/s²",
      potential: "Potential",
      damping: "Damping",
      geometry: "Geometry",
      energization: "Energization",
    },
    damping: { name: "Damping λmax(B) + β", unit: "1/s" },
    margin: { name: "Distance to the nearest joint limit", unit: "rad" },
  },
} as const;

const UPDATE = "Use Chrome 111+, Firefox 121+ or Safari 16.4+.";
export const CHECK = {
  title: "Self-check",
  supported: "Fully supported",
  missing: (count: number) => `${count} required ${count === 1 ? "feature" : "features"} missing`,
  optionalMissing: (count: number) => `Supported; ${count} optional ${count === 1 ? "feature" : "features"} missing`,
  optional: (hint: string) => `Optional. ${hint}`,
  available: "Available",
  cores: (count: number) => `${count} cores`,
  gigabytes: (count: number) => `${count} GB or more`,
  close: "Close",
  webAssembly: { name: "WebAssembly", hint: UPDATE },
  simd: { name: "SIMD", hint: UPDATE },
  workers: { name: "Workers", hint: UPDATE },
  webgl: { name: "WebGL 2", isOptional: true, hint: "Enable hardware acceleration. Without WebGL, the page uses a 2D canvas; everything else works." },
  storage: { name: "Storage", isOptional: true, hint: "Meshes are lost when the page is closed. Exit private browsing to keep them." },
  isolation: {
    name: "Isolation",
    isOptional: true,
    detail: "High-resolution timers",
    hint: "The host must send COOP and COEP headers, as `ngf serve` does.",
  },
  memory: { name: "Memory", isOptional: true, hint: "Close other tabs." },
  video: { name: "Video", isOptional: true, hint: "Use a screen recorder instead." },
} as const;

const OPEN_ORIGINAL = "Open it on the site where it was created to reproduce the attempt.";
export const LINK = {
  unknownVersion: (version: string) => `version ${version} is not supported by this page`,
  fieldMissing: (field: string) => `field "${field}" is missing`,
  fieldInvalid: (field: string, value: string) => `field "${field}" has the invalid value "${value}"`,
  fieldNotNumbers: (field: string, count: number) => `field "${field}" must have ${count} numbers`,
  invalid: (why: string) => ({ message: `Invalid link: ${why}.`, hint: "This link was changed on its way, for example shortened by a mail program. Ask the sender for it again." }),
  sceneMismatch: { message: "This link was made with a different version of the scene; the result may differ.", hint: OPEN_ORIGINAL },
  modelMismatch: (policy: string) => ({
    message: `This link was made with a different version of policy "${policy}"; the result may differ.`,
    hint: OPEN_ORIGINAL,
  }),
  needsFile: (object: string) => ({
    message: `This link refers to the mesh file "${object}", which it does not contain.`,
    hint: "Ask the sender for the file and drop it here.",
  }),
  objectMismatch: (object: string) => ({
    message: `${object} does not match the object of the link: shape, mass or friction differs.`,
    hint: "Use the file that the link was created with.",
  }),
  resultMismatch: {
    message: "The final state differs from the one in the link.",
    hint: "Policy, object and scene must match those of the link; see the messages above.",
  },
} as const;

export const FILES = {
  reading: (file: string) => `Reading ${file}`,
  cannotOpen: (archive: string, why: string) => `${archive} cannot be opened: ${why}`,
  noMesh: (archive: string) => `${archive} contains no ${MESH_FORMATS} file`,
  encrypted: "it is encrypted",
  noArchiveCode: "the code for ZIP files could not be downloaded",
  unknownCompression: (file: string) => `${file} uses an unsupported compression method`,
  entryTooLarge: (file: string) => `${file} is larger than 250 MB`,
  totalTooLarge: "its files exceed 500 MB in total",
  unreadableArchive: (message: string) => ({ message: `${message}.`, hint: "Extract the mesh and drop that file." }),
  skipped: (max: number) => ({ message: `More than ${max} files: only the first ${max} were added.`, hint: "Add the remaining files in batches." }),
  unreadable: (file: string, why: string) => ({
    message: `${file} could not be read: ${why}`,
    hint: "Check that the file exists and is readable, then select it again.",
  }),
  noReader: (file: string, why: string) => ({
    message: `${file} could not be read, because the code for mesh files was not downloaded: ${why}`,
    hint: "Check the network connection, then select the file again.",
  }),
  notStored: (file: string) => ({
    message: `${file} could not be stored in this browser; it stays in the list until the page is closed.`,
    hint: "Remove meshes that you no longer need, or add the file again on your next visit.",
  }),
  tooLarge: (file: string, megabytes: string, max: number) => ({
    message: `${file} is ${megabytes} MB; the maximum is ${max} MB.`,
    hint: "Reduce the number of triangles; a few thousand suffice for grasping.",
  }),
  notLoaded: (why: string) => ({
    message: `The file in this URL could not be loaded: ${why}`,
    hint: "The file may have been deleted. Check the URL and reload the page.",
  }),
} as const;

export const ERRORS = {
  copied: "Copied",
  restart: "Restart",
  retryDownload: "Retry download",
  notLoaded: (why: string) => ({ message: why, hint: `Reload the page. ${UPDATE}` }),
  pageError: (why: string) => ({ message: `Internal page error: ${why}`, hint: "Reload the page; your meshes are stored." }),
  offline: {
    message: "No network connection.",
    hint: "Built-in objects, your meshes and the loaded policy still work. Other policies and links need a connection.",
  },
  unsupported: { message: "This browser does not support WebAssembly with SIMD, which the simulation requires.", hint: UPDATE },
  stopped: (why: string | undefined) => ({
    message: why ? `The simulation stopped: ${why}` : "The simulation did not start.",
    hint: "Restart it; the page is not affected.",
  }),
  graphicsLost: {
    message: "The browser lost the graphics context.",
    hint: "It is usually restored automatically, and the simulation continues. Otherwise reload the page.",
  },
  webglUnavailable: (why: string) => ({
    message: `WebGL is not available, so a 2D canvas is used: ${why}`,
    hint: "Everything else works. For lighting and shadows, enable hardware acceleration or use another browser.",
  }),
  graphicsUnavailable: (why: string) => ({
    message: `The scene cannot be rendered: ${why}`,
    hint: "The simulation still runs and reports outcomes. Try another browser.",
  }),
} as const;
