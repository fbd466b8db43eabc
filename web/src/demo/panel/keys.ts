// Keys for what the buttons do. A field that is being typed in keeps its keys, what is pressed with Space its Space.

export function onKeys(actions: Record<string, () => void>, other: (key: string) => boolean): void {
  addEventListener("keydown", (event) => {
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

function isTaken({ target, key }: KeyboardEvent): boolean {
  if (!(target instanceof HTMLElement)) return true;
  const dialog = target.closest("dialog");
  // The focus leaves a dialog a moment after it has closed.
  if (dialog) return dialog.open;
  if (target.closest("input[type=number], select")) return true;
  const isControl = target.closest("button, input, summary") !== null;
  return isControl && (key === " " || key.startsWith("Arrow"));
}
