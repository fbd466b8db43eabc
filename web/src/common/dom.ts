// Elements of index.html, by id and type.

export function element<T extends Element>(id: string, type: abstract new () => T): T {
  const found = document.getElementById(id);
  if (!(found instanceof type)) throw new Error(`index.html has no ${type.name} with id ${id}`);
  return found;
}

// The buttons of a group of which one is chosen at a time.
export function choice(id: string, chosen: (value: string) => void): (value: string | null) => void {
  const buttons = [...element(id, HTMLElement).querySelectorAll("button")];
  for (const button of buttons) button.addEventListener("click", () => chosen(button.value));
  return (value) => {
    for (const button of buttons) button.setAttribute("aria-pressed", String(button.value === value));
  };
}
