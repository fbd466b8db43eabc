// Bottom sheet for the settings on narrow screens, opened by a tap or a swipe.

import { element } from "../../common/dom";

// Minimum length of a swipe (px).
const SWIPE = 24;

export function initBottomSheet(): void {
  const sheet = element("sheet", HTMLElement);
  const handle = element("handle", HTMLButtonElement);
  const setOpen = (isOpen: boolean) => {
    sheet.classList.toggle("is-open", isOpen);
    handle.setAttribute("aria-expanded", String(isOpen));
  };
  let start: number | null = null;
  handle.addEventListener("click", () => setOpen(!sheet.classList.contains("is-open")));
  handle.addEventListener("touchstart", (event) => (start = event.touches[0]?.clientY ?? null), { passive: true });
  handle.addEventListener("touchend", (event) => {
    const end = event.changedTouches[0]?.clientY;
    if (start === null || end === undefined || Math.abs(end - start) < SWIPE) return;
    // Suppresses the click that would follow a swipe.
    event.preventDefault();
    setOpen(end < start);
  });
}
