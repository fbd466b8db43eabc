// Pieces that the pages of the server are made of.

import { Refused } from "./api";
import { h } from "./dom";
import { size } from "./numbers";
import { RELOAD } from "./strings";

// Names and values.
export function facts(pairs: [string, Node | string][]): HTMLElement {
  return h("dl", { class: "facts" }, ...pairs.map(([name, value]) => h("div", {}, h("dt", {}, name), h("dd", {}, value))));
}

export function section(name: string, ...content: (Node | string | null | false)[]): HTMLElement {
  return h("section", {}, h("h2", {}, name), ...content);
}

// A table; numbers stand to the right.
export function table(head: readonly string[], rows: (Node | string)[][], numeric: number[] = []): HTMLElement {
  const isNumber = (i: number) => (numeric.includes(i) ? "is-number" : null);
  return h(
    "div",
    { class: "scroll", tabindex: 0, role: "region", "aria-label": head.join(", ") },
    h(
      "table",
      {},
      h("thead", {}, h("tr", {}, ...head.map((name, i) => h("th", { scope: "col", class: isNumber(i) }, name)))),
      h("tbody", {}, ...rows.map((row) => h("tr", {}, ...row.map((cell, i) => h("td", { class: isNumber(i) }, cell))))),
    ),
  );
}

// What went wrong, what to do about it, and how programs call it.
export function failureCard(cause: string, cure: string, code: string): HTMLElement {
  return h("article", { class: "failure", role: "alert" }, h("h2", {}, cause), cure && h("p", {}, cure), code && h("code", {}, code));
}

// What was refused; what else goes wrong is told as it is.
export function refusal(error: unknown): HTMLElement {
  if (!(error instanceof Refused)) return failureCard(String(error), RELOAD, "");
  const { detail, hint, code, request_id } = error.problem;
  return failureCard(detail, hint, [code, request_id].filter(Boolean).join(" "));
}

export function download(url: string, label: string, bytes?: number): HTMLElement {
  return h("a", { href: url, download: label }, bytes === undefined ? label : `${label} (${size(bytes)})`);
}

export function link(route: string, text: string): HTMLElement {
  return h("a", { href: `#${route}` }, text);
}
