// What the demo says. Static text stands in index.html; what happens in the simulation is told by the worker.

import type { Tally } from "./protocol";

export const ATTEMPT = {
  phases: {
    idle: "Drag the object, or press Grasp.",
    approach: "Moving to the start over the object",
    lift: "Lifting",
    hold: "Holding for two seconds",
  },
  policy: "Policy",
  planner: "Planner",
  closes: (actor: string) => `The ${actor} closes the hand`,
  stopped: "Stopped",
  restarting: "Starting again…",
  unsupported: "This browser cannot run it",
  seed: (seed: number) => `Seed ${seed}`,
  byHand: (x: string, y: string, yaw: string) => `, placed by hand at ${x}, ${y} m, ${yaw} rad,`,
  noPolicy: (what: string) => `${what}. No policy acts.`,
  ended: (what: string, hash: string) => `${what} ended in state ${hash}`,
  pulled: "Somebody pulled at the object: this one does not count.",
  asInLink: (note: string | null) => `${note}, as in the link`,
  asRecorded: (note: string | null) => `${note}, as recorded`,
  notAsRecorded: (note: string | null) => `${note}, and not in the one that was recorded: something differs here`,
} as const;

// How attempts came out so far.
export const TALLY = {
  none: "None yet with this object",
  hint: "A seed fixes the pose, the camera’s noise and the target.",
  lifted: ({ lifted, attempts }: Tally) => `${lifted} of ${attempts} lifted`,
  interval: (least: string, most: string) =>
    `With this object: between ${least} and ${most} of attempts, by the 95 % interval. A repeat counts once.`,
} as const;

export const BATCH = {
  run: "Run",
  stop: "Stop",
  ended: (seed: number, words: string) => `Seed ${seed}: ${words}`,
  watch: "Watch",
  watchSeed: (seed: number) => `Watch seed ${seed}`,
  of: (name: string, counted: string) => `${name}: ${counted}`,
  between: (counted: string, least: string, most: string) => `${counted} (${least} to ${most})`,
  alone: (first: string, a: number, second: string, b: number, both: number) =>
    `Of the ${both} that both tried, ${first} alone lifted ${a}, ${second} alone ${b}.`,
} as const;

export const PLAYBACK = {
  pause: "Pause",
  goOn: "Go on",
  paused: "Paused",
  rate: (measured: string) => `${measured}× real time`,
  moment: (time: string, whole: string) => `${time} of ${whole} seconds`,
} as const;

// What is known of the object.
export const REPORT = {
  mesh: (triangles: string, watertight: boolean, parts: number) =>
    `${triangles} triangles, ${watertight ? "watertight" : "open"}, ${parts} convex ${parts === 1 ? "part" : "parts"}`,
  asInFile: "as in the file",
  steadiest: "on its steadiest side",
  onSide: (number: number) => `on side ${number}`,
} as const;

export const COMPARISON = {
  planner: "planner",
  loading: (policy: string) => `${policy}: loading`,
  again: (policy: string) => `${policy} again`,
  givenUp: "The comparison is closed; the attempt goes on. Choose the policy again to compare.",
} as const;

export const TRAINING = {
  acts: (step: string) => `Step ${step} acts, the newest so far.`,
  newest: (step: string) => `Step ${step} is the newest so far.`,
  over: "The training is over.",
  lost: "The server does not answer: what is learned meanwhile comes when it is back.",
} as const;

export const SEARCH = {
  hint: "Every mesh gets an answer: grasps are tried in physics, without any learning, and the best one is played.",
  begin: "Search a grasp",
  trying: "Trying grasps…",
  stop: "Stop",
  stopped: "Stopped.",
  again: "Play again",
  givenUp: "The search has ended; the attempt goes on. Search again, or take a simpler mesh.",
} as const;

export const SHARE = {
  hint: "The link brings others to this attempt; it ends the same there.",
  noPolicy: "No link to this one: a link can only repeat what a policy does.",
  pulled: "No link to this one: a link cannot repeat how somebody pulled.",
  copied: "Copied.",
  copiedWithoutFile: "Copied. Others need the file of the object, too.",
  sending: (file: string) => `Sending ${file}…`,
  stopSending: "Stop sending",
  notSent: "It was not sent.",
  kept: "The server has the file: links to attempts with it suffice.",
  notKept: (why: string) => `This server does not keep the file: ${why}.`,
  tooLarge: (file: string, most: number) => `${file} is larger than ${most} MB`,
  noServer: "no server answers",
  film: "Film",
  stop: "Stop",
} as const;

export const INSIDE = {
  groups: { arm: "Arm", index: "Index", middle: "Middle", ring: "Ring", thumb: "Thumb" },
  stands: (now: string, lower: string, upper: string) => `${now} rad, from ${lower} to ${upper}`,
  plots: {
    energy: { name: "Energy ½ q̇ᵀq̇", unit: "rad²/s²" },
    terms: {
      name: "What accelerates the joints",
      unit: "rad/s²",
      potential: "Potential",
      damping: "Damping",
      geometry: "Geometry",
      energization: "Energization",
    },
    damping: { name: "Damping λmax(B) + β", unit: "1/s" },
    margin: { name: "Nearest limit", unit: "rad" },
  },
} as const;

// What this browser can do, and what helps where it cannot.
const UPDATE = "Use Chrome 111, Firefox 121, Safari 16.4 or newer.";
export const CHECK = {
  title: "Self-check",
  allWork: "This browser can do all of it",
  missing: (bad: number, all: number) => `${bad} of ${all} are missing`,
  works: "works",
  cores: (count: number) => `${count} cores`,
  gigabytes: (count: number) => `${count} GB or more`,
  close: "Close",
  webAssembly: { name: "WebAssembly", cure: UPDATE },
  simd: { name: "SIMD", cure: UPDATE },
  workers: { name: "Workers", cure: UPDATE },
  webgl: { name: "WebGL 2", cure: "Turn on hardware acceleration. Without it the picture is a flat sketch; everything else is as it should be." },
  storage: { name: "Storage", cure: "Meshes are forgotten when the page is left. Leave private browsing to keep them." },
  isolation: { name: "Isolation", told: "precise clocks", cure: "The host must send COOP and COEP, as `ngf serve` does. It works without, too." },
  memory: { name: "Memory", cure: "Close other pages." },
  film: { name: "Film", cure: "Record the screen instead." },
} as const;

// What is wrong with a link, and with what it brings about.
const SEE_THERE = "Open it where it was made to see it as it was.";
export const LINK = {
  unknownVersion: (version: string) => `it is of version ${version}, which this page does not know`,
  partMissing: (part: string) => `its part "${part}" is missing`,
  partUnknown: (part: string, value: string) => `its part "${part}" says "${value}", which means nothing`,
  partNotNumbers: (part: string, count: number) => `its part "${part}" is not ${count} numbers`,
  damaged: (why: string) => ({ cause: `This link is damaged: ${why}.`, cure: "Ask for it again; perhaps a part of it was cut off." }),
  otherScene: { cause: "This link was made with another version of the scene: the attempt may end otherwise.", cure: SEE_THERE },
  otherModel: (policy: string) => ({ cause: `The policy "${policy}" is not the one of the link: the attempt may end otherwise.`, cure: SEE_THERE }),
  needsFile: (object: string) => ({
    cause: `This link is about "${object}", a file that it does not contain.`,
    cure: "Get the file from whoever sent the link, and drop it here.",
  }),
  otherObject: (object: string) => ({
    cause: `${object} is not the object of the link: its shape, mass or friction is another.`,
    cure: "Look for the very file that the link was made with.",
  }),
  otherEnd: {
    cause: "The attempt ended in another state than in the link.",
    cure: "Policy, object and scene must be those of the link; compare the notes above.",
  },
} as const;

// What is wrong with a file or an archive of them.
export const FILES = {
  cannotOpen: (archive: string, why: string) => `${archive} cannot be opened: ${why}`,
  noMesh: (archive: string) => `${archive} holds no OBJ, STL, PLY, OFF, GLB or glTF file`,
  noEnd: "it has no end: perhaps it was not copied as a whole",
  damagedList: "its list of files is damaged",
  cutOff: "a part of it is missing: perhaps it was not copied as a whole",
  unknownPacking: (file: string) => `${file} is packed in a way that browsers do not know`,
  tooLong: (file: string) => `${file} is larger than 250 MB`,
  tooMuch: "its files have more than 500 MB together",
  unusable: (cause: string) => ({ cause: `${cause}.`, cure: "Take the mesh out of it, and drop that." }),
  cut: (most: number) => ({ cause: `More than ${most} files can be read there: the first ${most} were taken.`, cure: "Bring the others in parts." }),
  unreadable: (file: string, why: string) => ({
    cause: `${file} could not be read: ${why}`,
    cure: "Check that it still exists and may be read, and choose it again.",
  }),
  notKept: (file: string) => ({
    cause: `This browser has no room to keep ${file}, or may not keep anything: it is in the list until the page is left.`,
    cure: "Remove meshes that you no longer need, or bring it again on the next visit.",
  }),
  tooLarge: (file: string, megabytes: string, most: number) => ({
    cause: `${file} has ${megabytes} MB, more than ${most}.`,
    cure: "Reduce the number of its triangles; the hand does not feel more than a few thousand.",
  }),
  notFetched: (why: string) => ({
    cause: `What this address asks for could not be fetched: ${why}`,
    cure: "Follow the link again; it may have been deleted meanwhile.",
  }),
} as const;

// What else fails.
export const FAILURES = {
  copied: "Copied",
  restart: "Restart",
  fetchAgain: "Fetch it again",
  notLoaded: (why: string) => ({ cause: why, cure: "Reload the page. It needs Chrome 111, Firefox 121, Safari 16.4 or newer." }),
  ofPage: (why: string) => ({ cause: `The page itself failed: ${why}`, cure: "Reload it; meshes that you brought are kept." }),
  offline: {
    cause: "There is no network.",
    cure: "What is here goes on: objects, meshes of yours, the policy that acts. Other policies and links can be asked for when it is back.",
  },
  unsupported: { cause: "This browser has no WebAssembly with SIMD, which the simulation is made of.", cure: UPDATE },
  stopped: (why: string | undefined) => ({
    cause: why ? `The simulation stopped: ${why}` : "The simulation did not start.",
    cure: "Restart it; the page itself is unharmed.",
  }),
  graphicsLost: {
    cause: "The browser took the graphics away.",
    cure: "They usually come back by themselves; the simulation goes on. Otherwise reload the page.",
  },
  graphicsFlat: (why: string) => ({
    cause: `There is no WebGL here, so the picture is a flat sketch: ${why}`,
    cure: "Everything else works. For light and shadow turn on hardware acceleration, or try another browser.",
  }),
  graphicsMissing: (why: string) => ({
    cause: `Nothing can be drawn here: ${why}`,
    cure: "The simulation runs and the verdicts are told all the same. Try another browser.",
  }),
} as const;
