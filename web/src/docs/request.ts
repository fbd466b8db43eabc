// One request: what it takes, an example for a shell, and what it answers when it is tried.

import { button, h } from "../common/dom";
import { refusal, table } from "../common/parts";
import { type Description, members, type Operation, type Parameter, resolve, type Schema } from "../common/openapi";
import { send } from "../common/api";
import { COPY_AS_CURL } from "../common/strings";
import { copyCommand, tokenHeader } from "../common/curl";
import { REQUEST, TRIED } from "./strings";

// Longer answers are cut.
const MOST_SHOWN = 20_000;

export function requestCard(description: Description, method: string, path: string, id: string): HTMLElement {
  const operation = description.paths[path]![method]!;
  const parameters = operation.parameters ?? [];
  const body = operation.requestBody?.content["application/json"]?.schema;
  const card = h(
    "section",
    { class: "request", id, "aria-label": `${method} ${path}` },
    h("h3", {}, h("b", { class: `is-${method}` }, method), " ", h("code", {}, path)),
    h("p", {}, prose([operation.summary, operation.description].filter(Boolean).join(" "))),
  );
  if (parameters.length > 0) card.append(parameterTable(parameters));
  if (body) card.append(bodyTable(description, body));
  card.append(answers(description, operation), tried(method, path, parameters, operation));
  return card;
}

function parameterTable(parameters: Parameter[]): HTMLElement {
  const rows = parameters.map((one) => [
    h("code", {}, one.name),
    [one.in, one.required && REQUEST.required].filter(Boolean).join(", "),
    typeOf(one.schema),
    prose(one.description),
  ]);
  return table(REQUEST.parameters, rows);
}

function bodyTable(description: Description, schema: Schema): HTMLElement {
  const variants = resolve(description, schema);
  const { properties, required } = members(description, schema);
  const params = (variants.allOf ?? []).flatMap((part) => resolve(description, part).oneOf ?? []);
  const rows: (Node | string)[][] = Object.entries(properties).map(([name, property]) => row(description, name, property, required));
  for (const { properties: variant } of params) {
    const kind = variant?.["kind"]?.enum?.[0] ?? "";
    rows.push([h("code", {}, "kind"), "", `"${kind}"`, ""]);
    const of = members(description, variant?.["params"] ?? {});
    for (const [name, property] of Object.entries(of.properties)) rows.push(row(description, `params.${name}`, property, of.required.map((one) => `params.${one}`)));
  }
  return table(REQUEST.members, rows);
}

function row(description: Description, name: string, schema: Schema, required: string[]): (Node | string)[] {
  const property = resolve(description, schema);
  return [h("code", {}, name), required.includes(name) ? REQUEST.required : "", typeOf(property), prose(property.description)];
}

// Words with names in them.
function prose(text = ""): HTMLElement {
  return h("span", {}, ...text.split("`").map((part, i) => (i % 2 === 0 ? part : h("code", {}, part))));
}

function typeOf(schema: Schema): string {
  if (schema.enum) return schema.enum.map((value) => `"${value}"`).join(" | ");
  const bounds = [schema.minimum !== undefined && REQUEST.from(schema.minimum), schema.maximum !== undefined && REQUEST.to(schema.maximum)].filter(Boolean);
  if (schema.items) return `${typeOf(schema.items)}[]`;
  if (schema.oneOf?.every((one) => one.type)) return [...new Set(schema.oneOf.map(typeOf))].join(" | ");
  const name = [schema.type ?? "object"].flat().filter((one) => one !== "null").join(" | ");
  return [name, ...bounds].join(" ");
}

function answers(description: Description, { responses }: Operation): HTMLElement {
  const item = ([status, { description: words, content }]: [string, Operation["responses"][string]]) => {
    const kinds = content ? h("small", { class: "hint" }, ` ${Object.keys(content).join(", ")}`) : null;
    return h("li", {}, h("code", {}, status === "default" ? REQUEST.otherwise : status), " ", prose(words), kinds, held(description, content));
  };
  return h("ul", { class: "answers" }, ...Object.entries(responses).map(item));
}

// The members of an answer in JSON; those of a problem are the same everywhere.
function held(description: Description, content: Operation["responses"][string]["content"]): HTMLElement | null {
  const rows = answerRows(description, content?.["application/json"]?.schema ?? {});
  return rows.length > 0 ? h("details", {}, h("summary", {}, REQUEST.held), table(REQUEST.answered, rows)) : null;
}

// The members of an object, each followed by those of what it holds, however deep.
function answerRows(description: Description, schema: Schema, path = ""): (Node | string)[][] {
  const { additionalProperties: any, description: words } = resolve(description, schema);
  if (path === "" && typeof any === "object") return [[h("code", {}, "*"), typeOf(any), prose(words)]];
  return Object.entries(members(description, schema).properties).flatMap(([name, property]) => {
    const member = resolve(description, property);
    const each = typeof member.additionalProperties === "object" ? member.additionalProperties : undefined;
    const inner = member.items ?? each ?? member;
    const way = `${path}${name}${member.items ? "[]" : each ? ".*" : ""}.`;
    return [[h("code", {}, `${path}${name}`), typeOf(member), prose(member.description)], ...answerRows(description, inner, way)];
  });
}

// Fields for what is asked, the same for a shell, and the answer.
function tried(method: string, path: string, parameters: Parameter[], operation: Operation): HTMLElement {
  const asked = parameters.filter((one) => one.in !== "header");
  const inputs = asked.map((one) => h("input", { type: "text", placeholder: one.name, "aria-label": one.name, size: 14 }));
  const isJson = operation.requestBody?.content["application/json"] !== undefined;
  const text = isJson ? h("textarea", { rows: 4, "aria-label": TRIED.body, spellcheck: "false" }) : null;
  if (text) text.value = example(operation);
  const file = operation.requestBody && !isJson ? h("input", { type: "file", "aria-label": TRIED.file }) : null;
  const shell = h("code");
  const answer = h("pre", { class: "answer", tabindex: 0, hidden: true, role: "region", "aria-label": TRIED.answer });
  const url = () => {
    let filled = path;
    const query = new URLSearchParams();
    asked.forEach((one, i) => {
      const value = inputs[i]!.value;
      if (one.in === "path") filled = filled.replace(`{${one.name}}`, value === "" ? `{${one.name}}` : encodeURIComponent(value));
      else if (value !== "") query.set(one.name, value);
    });
    return new URL(`..${filled}${query.size > 0 ? `?${query}` : ""}`, location.href).href;
  };
  const command = () => {
    const verb = method === "get" || (method === "post" && (text || file)) ? "" : ` -X ${method.toUpperCase()}`;
    const token = method === "get" ? "" : tokenHeader();
    const quoted = (value: string) => `'${value.replaceAll("'", "'\\''")}'`;
    const data = text ? ` -d ${quoted(text.value)}` : file ? ` --data-binary ${quoted(`@${file.files?.[0]?.name ?? "FILE"}`)}` : "";
    const address = decodeURI(url());
    shell.textContent = `curl -fsS${verb}${token}${data} ${/[?&{]/.test(address) ? `"${address}"` : address}`;
  };
  const run = async () => {
    answer.hidden = false;
    answer.textContent = "…";
    let body: unknown;
    try {
      body = text ? (JSON.parse(text.value) as unknown) : file?.files?.[0];
    } catch (error) {
      answer.textContent = TRIED.noJson(String(error));
      return;
    }
    try {
      const got = await send(url(), method.toUpperCase(), body);
      answer.textContent = `${got.status}\n${await shown(got)}`;
      told.textContent = TRIED.answered(got.status);
    } catch (error) {
      answer.replaceChildren(refusal(error));
    }
  };
  for (const input of [...inputs, text, file]) input?.addEventListener("input", command);
  command();
  const isStream = path.endsWith("/stream");
  const told = h("p", { class: "hint told", role: "status" });
  const copy = button(
    COPY_AS_CURL,
    async () => {
      // The token may have been asked for since.
      command();
      told.textContent = await copyCommand(shell);
    },
    { class: "quiet" },
  );
  return h(
    "div",
    { class: "try" },
    h("div", { class: "inputs" }, ...inputs),
    text,
    file,
    h("div", { class: "shell" }, shell, copy, isStream ? null : button(TRIED.tryIt, run)),
    told,
    answer,
  );
}

async function shown(answer: Response): Promise<string> {
  const kind = answer.headers.get("content-type") ?? "";
  if (answer.status === 204) return "";
  if (/ndjson|openmetrics/.test(kind)) return cut(await answer.text());
  if (kind.includes("json")) return cut(JSON.stringify(await answer.json(), null, 2));
  if (kind.startsWith("text/")) return cut(await answer.text());
  const { size } = await answer.blob();
  return TRIED.bytes(size.toLocaleString("en"), kind);
}

function cut(text: string): string {
  if (text.length <= MOST_SHOWN) return text;
  return `${text.slice(0, MOST_SHOWN)}\n${TRIED.cut(MOST_SHOWN.toLocaleString("en"), text.length.toLocaleString("en"))}`;
}

// A small job; of a change or a report all may be left out.
function example(operation: Operation): string {
  return operation.operationId === "create" ? '{"kind": "dataset.generate", "params": {"preset": "smoke"}}' : "{}";
}
