// API page: all requests of the server, generated from its OpenAPI description. Each can be tried.

import { element, h } from "../common/dom";
import { caughtErrorCard } from "../common/components";
import { fetchOpenApi, type OpenApi } from "../common/openapi";
import { requestCard } from "./request";
import { version } from "./strings";

const METHODS = ["get", "post", "patch", "delete"];

const requests = element("requests", HTMLElement);
try {
  show(await fetchOpenApi());
} catch (error) {
  requests.replaceChildren(caughtErrorCard(error));
}

function show(api: OpenApi): void {
  const { info } = api;
  requests.append(
    h("h1", {}, info.title),
    h("p", { class: "hint" }, version(info.version), h("a", { href: "../openapi.json" }, "openapi.json"), "."),
    h("p", {}, info.description ?? ""),
  );
  const contents = element("contents", HTMLElement);
  for (const [tag, operations] of byTag(api)) {
    const list = h("ul");
    requests.append(h("h2", { id: tag }, tag));
    for (const { method, path, id } of operations) {
      requests.append(requestCard(api, method, path, id));
      const anchor = h("a", { href: `#${id}` }, h("b", { class: `is-${method}` }, method), ` ${shortPath(path)}`);
      list.append(h("li", {}, anchor));
    }
    contents.append(h("h2", {}, tag), list);
  }
  // The target of the URL's fragment did not exist when the page loaded.
  document.getElementById(location.hash.slice(1))?.scrollIntoView();
}

interface RequestEntry {
  method: string;
  path: string;
  // Element id of the request's card.
  id: string;
}

function byTag(api: OpenApi): Map<string, RequestEntry[]> {
  const tags = new Map<string, RequestEntry[]>();
  for (const [path, operations] of Object.entries(api.paths)) {
    for (const method of METHODS.filter((method) => method in operations)) {
      const tag = operations[method]?.tags?.[0] ?? "server";
      const id = `${method}-${shortPath(path).replaceAll(/[^a-z]+/gi, "-").replace(/^-|-$/g, "")}`;
      tags.set(tag, [...(tags.get(tag) ?? []), { method, path, id }]);
    }
  }
  return tags;
}

function shortPath(path: string): string {
  return path.replace("/api/v1", "") || "/";
}
