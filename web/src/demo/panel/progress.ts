// One bar for whatever takes its time.

import { element } from "../../common/dom";
import { outOf } from "../../common/strings";
import type { Progress } from "../protocol";

// What can be stopped has a button for it.
export function showProgress(progress: Progress, canStop: boolean): void {
  if (progress.finished) return endProgress();
  element("progress", HTMLElement).hidden = false;
  element("progress-stop", HTMLButtonElement).hidden = !canStop;
  const bar = element("progress-bar", HTMLProgressElement);
  if (progress.total === null) bar.removeAttribute("value");
  else [bar.max, bar.value] = [progress.total, progress.done];
  element("progress-label", HTMLElement).textContent = `${progress.label} ${amount(progress)}`;
}

export function endProgress(): void {
  element("progress", HTMLElement).hidden = true;
}

function amount({ done, total, unit }: Progress): string {
  if (unit === "steps") return total === null ? "" : outOf(done, total);
  const megabytes = (bytes: number) => (bytes / 1e6).toFixed(1);
  return `${total === null ? megabytes(done) : outOf(megabytes(done), megabytes(total))} MB`;
}
