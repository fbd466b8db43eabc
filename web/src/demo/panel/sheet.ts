// The settings on a phone: a sheet that opens over the foot of the picture.

import { element } from "../../common/dom";

const SWIPE = 24;

export function makeSheet(): void {
  const sheet = element("sheet", HTMLElement);
  const handle = element("handle", HTMLButtonElement);
  const set = (open: boolean) => {
    sheet.classList.toggle("is-open", open);
    handle.setAttribute("aria-expanded", String(open));
  };
  let begin: number | null = null;
  handle.addEventListener("click", () => set(!sheet.classList.contains("is-open")));
  handle.addEventListener("touchstart", (event) => (begin = event.touches[0]?.clientY ?? null), { passive: true });
  handle.addEventListener("touchend", (event) => {
    const end = event.changedTouches[0]?.clientY;
    if (begin === null || end === undefined || Math.abs(end - begin) < SWIPE) return;
    // A swipe is no tap.
    event.preventDefault();
    set(end < begin);
  });
}
