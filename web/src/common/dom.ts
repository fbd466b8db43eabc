// DOM helpers: typed lookup by id, element construction, buttons, clipboard.

export function element<T extends Element>(id: string, type: abstract new () => T): T {
  const found = document.getElementById(id);
  if (!(found instanceof type)) throw new Error(`the page has no ${type.name} with id ${id}`);
  return found;
}

// Button group with one active button. Returns the function that sets the active value.
export function choice(id: string, onChoose: (value: string) => void): (value: string | null) => void {
  const buttons = [...element(id, HTMLElement).querySelectorAll("button")];
  for (const button of buttons) button.addEventListener("click", () => onChoose(button.value));
  return (value) => {
    for (const button of buttons) button.setAttribute("aria-pressed", String(button.value === value));
  };
}

export type Child = Node | string | null | false | undefined;
export type Attributes = Record<string, string | number | boolean | null | ((event: Event) => void)>;

// Creates an HTML element. Function values become listeners, `true` an empty attribute; `null` and `false` are skipped.
export function h<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  attributes: Attributes = {},
  ...children: Child[]
): HTMLElementTagNameMap[K] {
  const created = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (typeof value === "function") created.addEventListener(name, value);
    else if (value === true) created.setAttribute(name, "");
    else if (value !== null && value !== false) created.setAttribute(name, String(value));
  }
  created.append(...children.filter((child): child is Node | string => Boolean(child)));
  return created;
}

// Creates an SVG element.
export function svg<K extends keyof SVGElementTagNameMap>(
  tag: K,
  attributes: Record<string, string | number> = {},
  ...children: (Node | string)[]
): SVGElementTagNameMap[K] {
  const created = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) created.setAttribute(name, String(value));
  created.append(...children);
  return created;
}

// Button for an asynchronous action; disabled while the action runs. An error is dispatched as the bubbling event
// "action-error". If no listener cancels that event, the error is thrown and reaches the browser's console.
export function button(label: string, act: () => unknown, attributes: Attributes = {}): HTMLButtonElement {
  const created: HTMLButtonElement = h("button", { type: "button", ...attributes }, label);
  created.addEventListener("click", async () => {
    const hadFocus = document.activeElement === created;
    created.disabled = true;
    try {
      await act();
    } catch (error) {
      const event = new CustomEvent("action-error", { bubbles: true, cancelable: true, detail: error });
      const isHandled = !created.dispatchEvent(event);
      if (!isHandled) throw error;
    } finally {
      created.disabled = false;
      // A disabled button loses focus. Restore it unless the user has moved focus since.
      if (hadFocus && document.activeElement === document.body) created.focus({ preventScroll: true });
    }
  });
  return created;
}

// Text with `code` between backticks, as nodes.
export function withCode(text: string): (Node | string)[] {
  return text.split("`").map((part, i) => (i % 2 === 1 ? h("code", {}, part) : part));
}

// Copies `text` (default: the text of `element`) and returns whether that succeeded. Pages served by plain HTTP from
// another machine have no clipboard; the element's text is then selected for manual copying.
export async function copyText(element: HTMLElement, text = element.textContent ?? ""): Promise<boolean> {
  try {
    await navigator.clipboard.writeText(text);
    return true;
  } catch {
    getSelection()?.selectAllChildren(element);
    return false;
  }
}
