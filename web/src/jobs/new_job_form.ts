// Form for a new job, generated from the server's OpenAPI description. Input is validated and estimated on change.

import { API, ApiError, requestJson } from "../common/api";
import { button, h } from "../common/dom";
import { caughtErrorCard } from "../common/components";
import { fetchOpenApi, objectProperties, type OpenApi, type Schema } from "../common/openapi";
import { byteSize, duration, label, number } from "../common/numbers";
import { COPY_AS_CURL } from "../common/strings";
import { copyCommand, tokenHeader } from "../common/curl";
import type { JobFeed } from "./job_feed";
import { fetchAll } from "./paginated_table";
import { KINDS } from "./kinds";
import { DATASETS, FORM, PARAMETERS } from "./strings";
import { type Job, title } from "./types";
import type { View } from "./main_view";

type Field = HTMLInputElement | HTMLSelectElement;

// Delay between the last input and its validation.
const VALIDATION_DELAY_MS = 350;

// Longer hints are shown below the field (characters).
const MAX_INLINE_HINT = 70;

type ServerRecord = { id: string } & Record<string, unknown>;

// Parameters that refer to a record: list path and option text.
const RECORDS: Record<string, { path: string; label: (record: ServerRecord) => string }> = {
  dataset_id: { path: "datasets", label: ({ id, config }) => `${String(id)}, ${datasetObjects(config)}` },
  encoder_id: { path: "models", label: modelLabel },
  model_id: { path: "models", label: modelLabel },
  mesh_id: { path: "meshes", label: ({ name }) => String(name) },
};

export class NewJobForm implements View {
  readonly element = h("article", { class: "new-job" }, h("h1", {}, FORM.title));
  readonly #feed: JobFeed;
  readonly #kinds = h("fieldset", { class: "kinds" }, h("legend", { class: "visually-hidden" }, FORM.kind));
  readonly #fields = h("div", { class: "fields" });
  readonly #estimate = h("p", { class: "estimate", role: "status" });
  readonly #error = h("div");
  readonly #command = h("code", { class: "command", hidden: true });
  readonly #copyStatus = h("p", { class: "hint copy-status", role: "status" });
  readonly #name = h("input", { type: "text", maxlength: 200, placeholder: FORM.optional });
  readonly #inputs = new Map<string, Field>();
  #api: OpenApi | null = null;
  #kind = Object.keys(KINDS)[0]!;
  #timer = 0;
  #numRequests = 0;
  // Idempotency key of the current input: a request that is repeated after a lost response creates one job.
  #key = randomKey();
  #isClosed = false;

  constructor(feed: JobFeed, query: URLSearchParams) {
    this.#feed = feed;
    const submit = button(FORM.start, () => this.#submit(), { class: "primary" });
    const copy = button(COPY_AS_CURL, () => this.#copy());
    this.element.append(
      this.#kinds,
      h("label", { class: "line" }, h("span", {}, FORM.name), this.#name),
      this.#fields,
      this.#estimate,
      this.#error,
      h("div", { class: "actions" }, submit, copy),
      this.#copyStatus,
      this.#command,
    );
    this.element.addEventListener("input", () => this.#scheduleValidation());
    void this.#open(query);
  }

  close(): void {
    this.#isClosed = true;
    clearTimeout(this.#timer);
  }

  async #open(query: URLSearchParams): Promise<void> {
    try {
      this.#api = await fetchOpenApi();
      const clone = query.get("clone");
      const original = clone ? (this.#feed.jobs.get(clone) ?? (await this.#feed.fetch(clone))) : null;
      this.#kind = original?.kind ?? query.get("kind") ?? this.#kind;
      if (original) this.#name.value = FORM.copyOf(title(original));
      for (const [value, text] of Object.entries(KINDS)) {
        const input = h("input", { type: "radio", name: "kind", value, change: () => void this.#changeKind(value) });
        input.checked = value === this.#kind;
        this.#kinds.append(h("label", {}, input, text));
      }
      await this.#showFields(this.#kind, original?.params ?? Object.fromEntries(query));
    } catch (error) {
      this.element.replaceChildren(h("h1", {}, FORM.title), caughtErrorCard(error));
    }
  }

  // Shows the fields of another kind, or the error if its options cannot be fetched.
  async #changeKind(kind: string): Promise<void> {
    try {
      await this.#showFields(kind, {});
    } catch (error) {
      if (this.#kind !== kind) return;
      this.#inputs.clear();
      this.#fields.replaceChildren();
      this.#showError(error);
    }
  }

  async #showFields(kind: string, values: Record<string, unknown>): Promise<void> {
    this.#kind = kind;
    const { properties, required } = this.#schema(kind);
    const names = Object.keys(properties).sort((a, b) => order(a, required) - order(b, required));
    const fields = await Promise.all(names.map(async (name) => [name, await this.#field(name, properties[name]!)] as const));
    // The user may have chosen another kind meanwhile.
    if (this.#kind !== kind) return;
    this.#inputs.clear();
    this.#fields.replaceChildren();
    for (const [name, input] of fields) {
      const value = values[name];
      if (value != null) {
        if (input instanceof HTMLInputElement && input.type === "checkbox") input.checked = value === true;
        else input.value = String(value);
      }
      this.#inputs.set(name, input);
      const hint = (properties[name]?.description ?? "").replaceAll("`", "");
      const note = h("small", { class: hint.length > MAX_INLINE_HINT ? "hint is-long" : "hint", id: `hint-${name}` }, hint);
      // The hint is inside the label element but not part of the field's name.
      const text = h("span", { id: `label-${name}` }, PARAMETERS[name] ?? label(name));
      input.setAttribute("aria-labelledby", text.id);
      input.setAttribute("aria-describedby", note.id);
      this.#fields.append(h("label", { class: "line", "data-param": name }, text, input, note));
    }
    await this.#validate();
  }

  #schema(kind: string): ReturnType<typeof objectProperties> {
    const api = this.#api!;
    const tasks = api.components.schemas["JobTask"]?.oneOf ?? [];
    const task = tasks.find(({ properties }) => properties?.["kind"]?.enum?.includes(kind));
    return objectProperties(api, task?.properties?.["params"] ?? {});
  }

  async #field(name: string, schema: Schema): Promise<Field> {
    const types = [schema.type ?? []].flat();
    const records = RECORDS[name];
    if (records || schema.enum) {
      const options = records ? await recordOptions(name, records) : schema.enum!.map((value): [string, string] => [value, label(value)]);
      const select = h("select");
      if (types.includes("null")) select.append(h("option", { value: "" }, "–"));
      for (const [value, text] of options) select.append(h("option", { value }, text));
      if (typeof schema.default === "string") select.value = schema.default;
      return select;
    }
    if (types.includes("boolean")) return h("input", { type: "checkbox" });
    if (types.includes("integer") || types.includes("number")) {
      return h("input", {
        type: "number",
        step: types.includes("integer") ? 1 : "any",
        min: schema.minimum ?? null,
        max: schema.maximum ?? null,
        inputmode: "decimal",
      });
    }
    const list = h("datalist", { id: `examples-${name}` }, ...(schema.examples ?? []).map((value) => h("option", { value })));
    document.getElementById(list.id)?.remove();
    this.element.append(list);
    return h("input", { type: "text", list: list.id, autocomplete: "off" });
  }

  #body(): Record<string, unknown> {
    const params: Record<string, unknown> = {};
    for (const [name, input] of this.#inputs) {
      if (input instanceof HTMLInputElement && input.type === "checkbox") {
        if (input.checked) params[name] = true;
      } else if (input.value !== "") {
        params[name] = input instanceof HTMLInputElement && input.type === "number" ? input.valueAsNumber : input.value;
      }
    }
    return { kind: this.#kind, params, ...(this.#name.value && { name: this.#name.value }) };
  }

  #scheduleValidation(): void {
    // A copied command no longer matches the input.
    this.#command.hidden = true;
    this.#copyStatus.textContent = "";
    this.#key = randomKey();
    clearTimeout(this.#timer);
    this.#timer = window.setTimeout(() => void this.#validate(), VALIDATION_DELAY_MS);
  }

  // Validates the input by a dry run and shows the estimate and default values.
  async #validate(): Promise<void> {
    const request = ++this.#numRequests;
    try {
      const job = await requestJson<Job>("jobs?dry_run=true", "POST", this.#body(), { skipTokenDialog: true });
      if (request !== this.#numRequests) return;
      this.#showError(null);
      for (const [name, input] of this.#inputs) {
        const resolved = job.params[name];
        if (input instanceof HTMLInputElement) input.placeholder = typeof resolved === "number" ? number(resolved) : "";
      }
      const { seconds, bytes } = job.estimate ?? {};
      const parts = [seconds && duration(seconds), bytes && byteSize(bytes)].filter((part) => typeof part === "string");
      this.#estimate.textContent = parts.length > 0 ? FORM.estimate(parts) : "";
    } catch (error) {
      if (request !== this.#numRequests) return;
      const isUnauthorized = error instanceof ApiError && error.problem.status === 401;
      this.#showError(isUnauthorized ? null : error);
      if (isUnauthorized) this.#estimate.textContent = FORM.tokenRequired;
    }
  }

  // Shows an error and marks the invalid parameters; `null` clears both.
  #showError(error: unknown): void {
    this.#error.replaceChildren();
    const problem = error instanceof ApiError ? error.problem : null;
    const params = problem?.errors?.map(({ param }) => param.split(".").pop()) ?? [];
    for (const [name, input] of this.#inputs) {
      const isInvalid = params.includes(name);
      input.setAttribute("aria-invalid", String(isInvalid));
    }
    if (error) {
      this.#estimate.textContent = "";
      this.#error.replaceChildren(caughtErrorCard(error));
    }
  }

  async #submit(): Promise<void> {
    // Cancels pending validation.
    clearTimeout(this.#timer);
    this.#numRequests += 1;
    try {
      const job = await requestJson<Job>("jobs", "POST", this.#body(), { headers: { "Idempotency-Key": this.#key } });
      this.#feed.put(job);
      this.#key = randomKey();
      // After a change of view, the user finds the job in the list.
      if (!this.#isClosed) location.hash = `#jobs/${job.id}`;
    } catch (error) {
      this.#showError(error);
    }
  }

  async #copy(): Promise<void> {
    const body = JSON.stringify(this.#body()).replaceAll("'", "'\\''");
    this.#command.textContent = `curl -fsS${tokenHeader()} -d '${body}' ${new URL("jobs", API).href}`;
    this.#command.hidden = false;
    this.#copyStatus.textContent = await copyCommand(this.#command);
  }
}

// `randomUUID` is unavailable on pages served by plain HTTP.
function randomKey(): string {
  return [...crypto.getRandomValues(new Uint32Array(4))].map((part) => part.toString(36)).join("-");
}

// Sort key of a field: required parameters first, threads and seed last.
function order(name: string, required: string[]): number {
  if (required.includes(name)) return 0;
  const first = ["preset", "policy", "object", "mesh_id", "mass_kg", "density_kg_m3", "attempts", "controls", "steps"].indexOf(name);
  const last = ["checkpoint_every", "threads", "seed"].indexOf(name);
  return last >= 0 ? 50 + last : first >= 0 ? 1 + first : 20;
}

async function recordOptions(name: string, { path, label: text }: (typeof RECORDS)[string]): Promise<[string, string][]> {
  const all = await fetchAll<ServerRecord>(path);
  // An encoder is not a policy.
  const records = name === "model_id" ? all.filter(({ kind }) => kind !== "encoder") : all;
  const options = records.map((record): [string, string] => [record.id, text(record)]);
  return name === "model_id" ? [...options, ["planner", FORM.planner]] : options;
}

function modelLabel({ id, kind, step }: Record<string, unknown>): string {
  return [String(id), kind, step == null ? null : FORM.step(String(step))].filter(Boolean).join(", ");
}

function datasetObjects(config: unknown): string {
  const objects = (config as { objects?: string[] } | undefined)?.objects ?? [];
  return objects.length > 3 ? DATASETS.objects(objects.length) : objects.map(label).join(", ");
}
