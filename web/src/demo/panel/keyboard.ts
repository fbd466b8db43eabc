// Keyboard shortcuts. Text fields keep their keys, buttons and switches keep Space. The user can turn the
// shortcuts off, for example for speech input.

import { element } from "../../common/dom";
import type { Preset } from "../view/camera";
import type { AttemptPanel } from "./attempt";
import type { LayerSwitches } from "./layers";
import type { Playback } from "./playback";
import type { SharePanel } from "./share";

// Key in localStorage; present if the shortcuts are off.
const STORAGE_KEY = "ngf-keys-off";

export interface Controls {
  attempt: AttemptPanel;
  playback: Playback;
  share: SharePanel;
  layers: LayerSwitches;
  help: HTMLDialogElement;
  goToPreset(preset: Preset): void;
}

// The actions of single keys, which the help dialog lists.
export function shortcuts({ attempt, playback, share, layers, help, goToPreset }: Controls): Record<string, () => void> {
  return {
    g: () => attempt.grasp(),
    r: () => attempt.newPose(),
    " ": () => playback.toggle(),
    ",": () => playback.back(),
    ".": () => playback.step(),
    l: () => void share.copy(),
    i: () => element("diagnostics", HTMLDetailsElement).querySelector("summary")?.click(),
    Backspace: () => playback.reset(),
    c: () => layers.toggle("cloud"),
    m: () => layers.toggle("reconstruction"),
    h: () => layers.toggle("hulls"),
    f: () => layers.toggle("forces"),
    t: () => layers.toggle("trail"),
    j: () => layers.toggle("target"),
    k: () => layers.toggle("limits"),
    s: () => layers.toggle("sensor"),
    "1": () => goToPreset("front"),
    "2": () => goToPreset("side"),
    "3": () => goToPreset("top"),
    "4": () => goToPreset("sensor"),
    "0": () => goToPreset("home"),
    "?": () => help.showModal(),
  };
}

// `onOther` handles keys without an action and returns whether it has used the key.
export function onKeys(actions: Record<string, () => void>, onOther: (key: string) => boolean): void {
  const areOn = element("keys-on", HTMLInputElement);
  areOn.checked = !areStoredOff();
  areOn.addEventListener("change", () => storeOff(!areOn.checked));
  addEventListener("keydown", (event) => {
    if (!areOn.checked) return;
    if (event.ctrlKey || event.metaKey || event.altKey || isUsedByTarget(event)) return;
    if (document.querySelector("dialog[open]")) return;
    const modifier = event.shiftKey && event.key.startsWith("Arrow") ? "Shift+" : "";
    const key = event.key.length === 1 ? event.key.toLowerCase() : modifier + event.key;
    const action = actions[key];
    // A held key repeats only the keys without an action, which move the object or the camera.
    if (action && !event.repeat) action();
    else if (!action && !onOther(key)) return;
    event.preventDefault();
  });
}

// Storage can be blocked by the browser.
function areStoredOff(): boolean {
  try {
    return localStorage.getItem(STORAGE_KEY) !== null;
  } catch {
    return false;
  }
}

function storeOff(areOff: boolean): void {
  try {
    if (areOff) localStorage.setItem(STORAGE_KEY, "");
    else localStorage.removeItem(STORAGE_KEY);
  } catch {
    // The setting then applies until the page is closed.
  }
}

function isUsedByTarget({ target, key }: KeyboardEvent): boolean {
  if (!(target instanceof HTMLElement)) return true;
  const dialog = target.closest("dialog");
  // The focus can still be in a dialog that has just closed.
  if (dialog) return dialog.open;
  if (target.closest("input[type=number], select")) return true;
  const isControl = target.closest("button, input, summary") !== null;
  return isControl && (key === " " || key.startsWith("Arrow"));
}
