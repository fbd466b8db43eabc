// Card of one request: parameters, body, responses, and a console that sends it.

import { button, h } from "../common/dom";
import { caughtErrorCard, table } from "../common/components";
import { objectProperties, type OpenApi, type Operation, type Parameter, resolve, type Schema } from "../common/openapi";
import { request } from "../common/api";
import { COPY_AS_CURL } from "../common/strings";
import { copyCommand, tokenHeader } from "../common/curl";
import { CONSOLE, REQUEST } from "./strings";

// Longer responses are truncated (characters).
const MAX_SHOWN = 20_000;

export function requestCard(api: OpenApi, method: string, path: string, id: string): HTMLElement {
  const operation = api.paths[path]![method]!;
  const parameters = operation.parameters ?? [];
  const body = operation.requestBody?.content["application/json"]?.schema;
  const card = h(
    "section",
    { class: "request", id, "aria-label": `${method} ${path}` },
    h("h3", {}, h("b", { class: `is-${method}` }, method), " ", h("code", {}, path)),
    h("p", {}, prose([operation.summary, operation.description].filter(Boolean).join(" "))),
  );
  if (parameters.length > 0) card.append(parameterTable(parameters));
  if (body) card.append(bodyTable(api, body));
  card.append(responses(api, operation), requestConsole(method, path, parameters, operation));
  return card;
}

function parameterTable(parameters: Parameter[]): HTMLElement {
  const rows = parameters.map((parameter) => [
    h("code", {}, parameter.name),
    [parameter.in, parameter.required && REQUEST.required].filter(Boolean).join(", "),
    typeOf(parameter.schema),
    prose(parameter.description),
  ]);
  return table(REQUEST.parameters, rows);
}

function bodyTable(api: OpenApi, schema: Schema): HTMLElement {
  const resolved = resolve(api, schema);
  const variants = (resolved.oneOf ?? []).map((variant) => resolve(api, variant));
  // Variants differ in their kind and parameters; the other members are the same.
  const { properties, required } = objectProperties(api, variants[0] ?? schema);
  const shared = Object.entries(properties).filter(([name]) => variants.length === 0 || !["kind", "params"].includes(name));
  const rows: (Node | string)[][] = shared.map(([name, property]) => row(api, name, property, required));
  for (const { properties: variant } of variants) {
    const kind = variant?.["kind"]?.enum?.[0] ?? "";
    rows.push([h("code", {}, "kind"), "", `"${kind}"`, ""]);
    const params = objectProperties(api, variant?.["params"] ?? {});
    const requiredParams = params.required.map((name) => `params.${name}`);
    for (const [name, property] of Object.entries(params.properties)) rows.push(row(api, `params.${name}`, property, requiredParams));
  }
  return table(REQUEST.members, rows);
}

function row(api: OpenApi, name: string, schema: Schema, required: string[]): (Node | string)[] {
  const property = resolve(api, schema);
  return [h("code", {}, name), required.includes(name) ? REQUEST.required : "", typeOf(property), prose(property.description)];
}

// Text with `code` in backticks.
function prose(text = ""): HTMLElement {
  return h("span", {}, ...text.split("`").map((part, i) => (i % 2 === 0 ? part : h("code", {}, part))));
}

function typeOf(schema: Schema): string {
  if (schema.enum) return schema.enum.map((value) => `"${value}"`).join(" | ");
  const bounds = [schema.minimum !== undefined && REQUEST.min(schema.minimum), schema.maximum !== undefined && REQUEST.max(schema.maximum)].filter(Boolean);
  if (schema.items) return `${typeOf(schema.items)}[]`;
  if (schema.oneOf?.every(({ type }) => type)) return [...new Set(schema.oneOf.map(typeOf))].join(" | ");
  const name = [schema.type ?? "object"].flat().filter((type) => type !== "null").join(" | ");
  return [name, ...bounds].join(" ");
}

function responses(api: OpenApi, { responses }: Operation): HTMLElement {
  const item = ([status, { description, content }]: [string, Operation["responses"][string]]) => {
    const types = content ? h("small", { class: "hint" }, ` ${Object.keys(content).join(", ")}`) : null;
    const statusText = status === "default" ? REQUEST.otherStatus : status;
    return h("li", {}, h("code", {}, statusText), " ", prose(description), types, responseSchema(api, content));
  };
  return h("ul", { class: "responses" }, ...Object.entries(responses).map(item));
}

// Members of a JSON response. Problem responses are omitted: their members are always the same.
function responseSchema(api: OpenApi, content: Operation["responses"][string]["content"]): HTMLElement | null {
  const rows = responseRows(api, content?.["application/json"]?.schema ?? {});
  return rows.length > 0 ? h("details", {}, h("summary", {}, REQUEST.schema), table(REQUEST.responseMembers, rows)) : null;
}

// Rows of an object's members, recursively.
function responseRows(api: OpenApi, schema: Schema, prefix = ""): (Node | string)[][] {
  const { additionalProperties: any, description } = resolve(api, schema);
  if (prefix === "" && typeof any === "object") return [[h("code", {}, "*"), typeOf(any), prose(description)]];
  return Object.entries(objectProperties(api, schema).properties).flatMap(([name, property]) => {
    const member = resolve(api, property);
    const value = typeof member.additionalProperties === "object" ? member.additionalProperties : undefined;
    const inner = member.items ?? value ?? member;
    const path = `${prefix}${name}${member.items ? "[]" : value ? ".*" : ""}.`;
    return [[h("code", {}, `${prefix}${name}`), typeOf(member), prose(member.description)], ...responseRows(api, inner, path)];
  });
}

// Console: input fields, the equivalent shell command, and the response.
function requestConsole(method: string, path: string, allParameters: Parameter[], operation: Operation): HTMLElement {
  const parameters = allParameters.filter((parameter) => parameter.in !== "header");
  const inputs = parameters.map(({ name }) => h("input", { type: "text", placeholder: name, "aria-label": name, size: 14 }));
  const isJson = operation.requestBody?.content["application/json"] !== undefined;
  const text = isJson ? h("textarea", { rows: 4, "aria-label": CONSOLE.body, spellcheck: "false" }) : null;
  if (text) text.value = exampleBody(operation);
  const file = operation.requestBody && !isJson ? h("input", { type: "file", "aria-label": CONSOLE.file }) : null;
  const command = h("code");
  const output = h("pre", { class: "response", tabindex: 0, hidden: true, role: "region", "aria-label": CONSOLE.response });
  const status = h("p", { class: "hint copy-status", role: "status" });
  const url = () => {
    let filled = path;
    const query = new URLSearchParams();
    parameters.forEach((parameter, i) => {
      const value = inputs[i]!.value;
      const placeholder = `{${parameter.name}}`;
      if (parameter.in === "path") filled = filled.replace(placeholder, value === "" ? placeholder : encodeURIComponent(value));
      else if (value !== "") query.set(parameter.name, value);
    });
    return new URL(`..${filled}${query.size > 0 ? `?${query}` : ""}`, location.href).href;
  };
  const updateCommand = () => {
    const methodFlag = method === "get" || (method === "post" && (text || file)) ? "" : ` -X ${method.toUpperCase()}`;
    const token = method === "get" ? "" : tokenHeader();
    const quoted = (value: string) => `'${value.replaceAll("'", "'\\''")}'`;
    const data = text ? ` -d ${quoted(text.value)}` : file ? ` --data-binary ${quoted(`@${file.files?.[0]?.name ?? "FILE"}`)}` : "";
    const address = decodeURI(url());
    command.textContent = `curl -fsS${methodFlag}${token}${data} ${/[?&{]/.test(address) ? `"${address}"` : address}`;
  };
  const send = async () => {
    output.hidden = false;
    output.textContent = "…";
    let body: unknown;
    try {
      body = text ? (JSON.parse(text.value) as unknown) : file?.files?.[0];
    } catch (error) {
      output.textContent = CONSOLE.invalidJson(String(error));
      return;
    }
    try {
      const response = await request(url(), method.toUpperCase(), body);
      output.textContent = `${response.status}\n${await bodyText(response)}`;
      status.textContent = CONSOLE.status(response.status);
    } catch (error) {
      output.replaceChildren(caughtErrorCard(error));
    }
  };
  for (const input of [...inputs, text, file]) input?.addEventListener("input", updateCommand);
  updateCommand();
  const isStream = path.endsWith("/stream");
  const copy = button(
    COPY_AS_CURL,
    async () => {
      // The server may have required the token since the last update.
      updateCommand();
      status.textContent = await copyCommand(command);
    },
    { class: "quiet" },
  );
  return h(
    "div",
    { class: "try" },
    h("div", { class: "inputs" }, ...inputs),
    text,
    file,
    h("div", { class: "shell" }, command, copy, isStream ? null : button(CONSOLE.send, send)),
    status,
    output,
  );
}

async function bodyText(response: Response): Promise<string> {
  const type = response.headers.get("content-type") ?? "";
  if (response.status === 204) return "";
  if (/ndjson|openmetrics/.test(type)) return truncate(await response.text());
  if (type.includes("json")) return truncate(JSON.stringify(await response.json(), null, 2));
  if (type.startsWith("text/")) return truncate(await response.text());
  const { size } = await response.blob();
  return CONSOLE.bytes(size.toLocaleString("en"), type);
}

function truncate(text: string): string {
  if (text.length <= MAX_SHOWN) return text;
  return `${text.slice(0, MAX_SHOWN)}\n${CONSOLE.truncated(MAX_SHOWN.toLocaleString("en"), text.length.toLocaleString("en"))}`;
}

// Example body: a small job. Other JSON bodies have only optional members.
function exampleBody(operation: Operation): string {
  return operation.operationId === "create" ? '{"kind": "dataset.generate", "params": {"preset": "smoke"}}' : "{}";
}
