// Keys for what the buttons do. A field that is being typed in keeps its keys, what is pressed with Space its Space.
// Whoever speaks to the computer, or rests a hand on the keys, can do without them.

import { element } from "../../common/dom";

const KEPT = "ngf-keys-off";

export function onKeys(actions: Record<string, () => void>, other: (key: string) => boolean): void {
  const areOn = element("keys-on", HTMLInputElement);
  areOn.checked = !isKept();
  areOn.addEventListener("change", () => keep(!areOn.checked));
  addEventListener("keydown", (event) => {
    if (!areOn.checked) return;
    if (event.ctrlKey || event.metaKey || event.altKey || isTaken(event)) return;
    if (document.querySelector("dialog[open]")) return;
    const held = event.shiftKey && event.key.startsWith("Arrow") ? "Shift+" : "";
    const key = event.key.length === 1 ? event.key.toLowerCase() : held + event.key;
    const action = actions[key];
    // A key that is held moves the object on, but presses a button once.
    if (action && !event.repeat) action();
    else if (!action && !other(key)) return;
    event.preventDefault();
  });
}

// A browser may keep nothing.
function isKept(): boolean {
  try {
    return localStorage.getItem(KEPT) !== null;
  } catch {
    return false;
  }
}

function keep(areOff: boolean): void {
  try {
    if (areOff) localStorage.setItem(KEPT, "");
    else localStorage.removeItem(KEPT);
  } catch {
    // Until the page is left it holds.
  }
}

function isTaken({ target, key }: KeyboardEvent): boolean {
  if (!(target instanceof HTMLElement)) return true;
  const dialog = target.closest("dialog");
  // The focus leaves a dialog a moment after it has closed.
  if (dialog) return dialog.open;
  if (target.closest("input[type=number], select")) return true;
  const isControl = target.closest("button, input, summary") !== null;
  return isControl && (key === " " || key.startsWith("Arrow"));
}
