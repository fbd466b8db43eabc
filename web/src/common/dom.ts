// Elements: those of the page by id and type, and new ones.

export function element<T extends Element>(id: string, type: abstract new () => T): T {
  const found = document.getElementById(id);
  if (!(found instanceof type)) throw new Error(`the page has no ${type.name} with id ${id}`);
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

export type Child = Node | string | null | false | undefined;
export type Attributes = Record<string, string | number | boolean | null | ((event: Event) => void)>;

// A new element; functions are listeners, true is an attribute without a value, null and false none.
export function h<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  attributes: Attributes = {},
  ...children: Child[]
): HTMLElementTagNameMap[K] {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (typeof value === "function") made.addEventListener(name, value);
    else if (value === true) made.setAttribute(name, "");
    else if (value !== null && value !== false) made.setAttribute(name, String(value));
  }
  made.append(...children.filter((child): child is Node | string => Boolean(child)));
  return made;
}

// A new element of a drawing.
export function svg<K extends keyof SVGElementTagNameMap>(
  tag: K,
  attributes: Record<string, string | number> = {},
  ...children: (Node | string)[]
): SVGElementTagNameMap[K] {
  const made = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, String(value));
  made.append(...children);
  return made;
}

// A button that says that it is at work until it is done. What goes wrong then is told by whoever hears its event
// "refused"; where nobody does, the browser's list of errors has it.
export function button(label: string, act: () => unknown, attributes: Attributes = {}): HTMLButtonElement {
  const made: HTMLButtonElement = h("button", { type: "button", ...attributes }, label);
  made.addEventListener("click", async () => {
    const hadFocus = document.activeElement === made;
    made.disabled = true;
    try {
      await act();
    } catch (error) {
      const refused = new CustomEvent("refused", { bubbles: true, cancelable: true, detail: error });
      const isTold = !made.dispatchEvent(refused);
      if (!isTold) throw error;
    } finally {
      made.disabled = false;
      // Who cannot be pressed has no focus; nobody else has taken it.
      if (hadFocus && document.activeElement === document.body) made.focus({ preventScroll: true });
    }
  });
  return made;
}

// Copies a text, that of an element unless another is given, and gives whether that was possible: a page that came over
// plain http from another machine has no clipboard. What is shown is selected then, so that whoever wants it copies it.
export async function copied(shown: HTMLElement, text = shown.textContent ?? ""): Promise<boolean> {
  try {
    await navigator.clipboard.writeText(text);
    return true;
  } catch {
    getSelection()?.selectAllChildren(shown);
    return false;
  }
}
