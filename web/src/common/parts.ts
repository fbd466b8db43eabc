// Pieces that the pages of the server are made of.

import { Refused } from "./api";
import { h } from "./dom";
import { size } from "./words";

// Names and values.
export function facts(pairs: [string, Node | string][]): HTMLElement {
  return h("dl", { class: "facts" }, ...pairs.map(([name, value]) => h("div", {}, h("dt", {}, name), h("dd", {}, value))));
}

export function section(name: string, ...content: (Node | string | null | false)[]): HTMLElement {
  return h("section", {}, h("h2", {}, name), ...content);
}

// A table; numbers stand to the right.
export function table(head: string[], rows: (Node | string)[][], numeric: number[] = []): HTMLElement {
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

// What was refused and what to do about it; what else goes wrong is told as it is.
export function refusal(error: unknown): HTMLElement {
  const problem = error instanceof Refused ? error.problem : null;
  return h(
    "article",
    { class: "failure", role: "alert" },
    h("h2", {}, problem?.detail ?? String(error)),
    h("p", {}, problem?.hint ?? "Reload the page; if it happens again, report it."),
    problem && h("code", {}, [problem.code, problem.request_id].filter(Boolean).join(" ")),
  );
}

export function download(url: string, label: string, bytes?: number): HTMLElement {
  return h("a", { href: url, download: label }, bytes === undefined ? label : `${label} (${size(bytes)})`);
}

export function link(route: string, text: string): HTMLElement {
  return h("a", { href: `#${route}` }, text);
}
