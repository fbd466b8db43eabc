// Components shared by the Jobs page and the API page.

import { ApiError } from "./api";
import { h, withCode } from "./dom";
import { byteSize } from "./numbers";
import { RELOAD } from "./strings";

// Name-value list.
export function factList(pairs: [string, Node | string][]): HTMLElement {
  return h("dl", { class: "facts" }, ...pairs.map(([name, value]) => h("div", {}, h("dt", {}, name), h("dd", {}, value))));
}

export function section(name: string, ...content: (Node | string | null | false)[]): HTMLElement {
  return h("section", {}, h("h2", {}, name), ...content);
}

// Scrollable table; the columns listed in `numeric` are right-aligned.
export function table(head: readonly string[], rows: (Node | string)[][], numeric: number[] = []): HTMLElement {
  const numberClass = (i: number) => (numeric.includes(i) ? "is-number" : null);
  return h(
    "div",
    { class: "scroll", tabindex: 0, role: "region", "aria-label": head.join(", ") },
    h(
      "table",
      {},
      h("thead", {}, h("tr", {}, ...head.map((name, i) => h("th", { scope: "col", class: numberClass(i) }, name)))),
      h("tbody", {}, ...rows.map((row) => h("tr", {}, ...row.map((cell, i) => h("td", { class: numberClass(i) }, cell))))),
    ),
  );
}

export function errorCard(message: string, hint: string, code: string): HTMLElement {
  return h("article", { class: "failure", role: "alert" }, h("h2", {}, message), hint && h("p", {}, ...withCode(hint)), code && h("code", {}, code));
}

// Card of a caught error: an API problem with its hint and code, or the error's text.
export function caughtErrorCard(error: unknown): HTMLElement {
  if (!(error instanceof ApiError)) return errorCard(String(error), RELOAD, "");
  const { detail, hint, code, request_id } = error.problem;
  return errorCard(detail, hint, [code, request_id].filter(Boolean).join(" "));
}

export function download(url: string, label: string, bytes?: number): HTMLElement {
  return h("a", { href: url, download: label }, bytes === undefined ? label : `${label} (${byteSize(bytes)})`);
}

export function link(route: string, text: string): HTMLElement {
  return h("a", { href: `#${route}` }, text);
}
