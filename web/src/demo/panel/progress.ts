// One bar for whatever takes its time: what can be stopped comes first, and then what moved last.

import { element } from "../../common/dom";
import { outOf } from "../../common/strings";
import type { Progress } from "../protocol";

// Whose work it is.
export type Whose = "worker" | "page";

// What is not over.
const running = new Map<Whose, { progress: Progress; canStop: boolean }>();

// What can be stopped has a button for it.
export function showProgress(whose: Whose, progress: Progress, canStop = false): void {
  running.delete(whose);
  if (!progress.finished) running.set(whose, { progress, canStop });
  draw();
}

export function endProgress(whose: Whose): void {
  running.delete(whose);
  draw();
}

function draw(): void {
  const all = [...running.values()];
  const shown = all.find(({ canStop }) => canStop) ?? all.at(-1);
  element("progress", HTMLElement).hidden = !shown;
  if (!shown) return;
  const { progress, canStop } = shown;
  element("progress-stop", HTMLButtonElement).hidden = !canStop;
  const bar = element("progress-bar", HTMLProgressElement);
  if (progress.total === null) bar.removeAttribute("value");
  else [bar.max, bar.value] = [progress.total, progress.done];
  element("progress-label", HTMLElement).textContent = `${progress.label} ${amount(progress)}`;
}

function amount({ done, total, unit }: Progress): string {
  if (unit === "steps") return total === null ? "" : outOf(done, total);
  const megabytes = (bytes: number) => (bytes / 1e6).toFixed(1);
  return `${total === null ? megabytes(done) : outOf(megabytes(done), megabytes(total))} MB`;
}
