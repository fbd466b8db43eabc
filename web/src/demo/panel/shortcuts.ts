// What single keys do; the sheet on "?" tells it.

import { element } from "../../common/dom";
import type { Preset } from "../view/camera";
import type { AttemptPanel } from "./attempt";
import type { LayerSwitches } from "./layers";
import type { Playback } from "./playback";
import type { SharePanel } from "./share";

export interface Controls {
  attempt: AttemptPanel;
  playback: Playback;
  share: SharePanel;
  layers: LayerSwitches;
  help: HTMLDialogElement;
  look(preset: Preset): void;
}

export function shortcuts({ attempt, playback, share, layers, help, look }: Controls): Record<string, () => void> {
  return {
    g: () => attempt.grasp(),
    r: () => attempt.newPose(),
    " ": () => playback.toggle(),
    ",": () => playback.back(),
    ".": () => playback.step(),
    l: () => void share.copy(),
    i: () => element("inside", HTMLDetailsElement).querySelector("summary")?.click(),
    Backspace: () => playback.reset(),
    c: () => layers.press("cloud"),
    m: () => layers.press("reconstruction"),
    h: () => layers.press("hulls"),
    f: () => layers.press("forces"),
    t: () => layers.press("trail"),
    j: () => layers.press("target"),
    k: () => layers.press("limits"),
    s: () => layers.press("sensor"),
    "1": () => look("front"),
    "2": () => look("side"),
    "3": () => look("top"),
    "4": () => look("sensor"),
    "0": () => look("home"),
    "?": () => help.showModal(),
  };
}
