// Progress bar, shared by worker and page. A task that can be stopped has priority, then the latest update.

import { element } from "../../common/dom";
import { outOf } from "../../common/strings";
import type { Progress } from "../worker/protocol";

export type ProgressSource = "worker" | "page";

// Unfinished tasks, in the order of their last update.
const running = new Map<ProgressSource, { progress: Progress; canStop: boolean }>();

export function showProgress(source: ProgressSource, progress: Progress, canStop = false): void {
  running.delete(source);
  if (!progress.finished) running.set(source, { progress, canStop });
  draw();
}

export function endProgress(source: ProgressSource): void {
  running.delete(source);
  draw();
}

function draw(): void {
  const tasks = [...running.values()];
  const shown = tasks.find(({ canStop }) => canStop) ?? tasks.at(-1);
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
