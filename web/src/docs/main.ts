// Every request that the server understands, made from its own description; each can be tried here.

import { element, h } from "../common/dom";
import { refusal } from "../common/parts";
import { type Description, describe } from "../common/openapi";
import { requestCard } from "./request";
import { version } from "./strings";

const METHODS = ["get", "post", "patch", "delete"];

const requests = element("requests", HTMLElement);
try {
  show(await describe());
} catch (error) {
  requests.replaceChildren(refusal(error));
}

function show(description: Description): void {
  const { info } = description;
  requests.append(
    h("h1", {}, info.title),
    h("p", { class: "hint" }, version(info.version), h("a", { href: "../openapi.json" }, "openapi.json"), "."),
    h("p", {}, info.description ?? ""),
  );
  const contents = element("contents", HTMLElement);
  for (const [tag, operations] of byTag(description)) {
    const list = h("ul");
    requests.append(h("h2", { id: tag }, tag));
    for (const { method, path, id } of operations) {
      requests.append(requestCard(description, method, path, id));
      const words = h("a", { href: `#${id}` }, h("b", { class: `is-${method}` }, method), ` ${short(path)}`);
      list.append(h("li", {}, words));
    }
    contents.append(h("h2", {}, tag), list);
  }
  // What the address names was not there when the page came.
  document.getElementById(location.hash.slice(1))?.scrollIntoView();
}

interface Place {
  method: string;
  path: string;
  id: string;
}

function byTag(description: Description): Map<string, Place[]> {
  const tags = new Map<string, Place[]>();
  for (const [path, operations] of Object.entries(description.paths)) {
    for (const method of METHODS.filter((method) => method in operations)) {
      const tag = operations[method]?.tags?.[0] ?? "server";
      const id = `${method}-${short(path).replaceAll(/[^a-z]+/gi, "-").replace(/^-|-$/g, "")}`;
      tags.set(tag, [...(tags.get(tag) ?? []), { method, path, id }]);
    }
  }
  return tags;
}

function short(path: string): string {
  return path.replace("/api/v1", "") || "/";
}
