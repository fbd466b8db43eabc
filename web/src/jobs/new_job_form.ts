// Form for a new job, generated from the server's OpenAPI description. Input is validated and estimated on change.

import { API, ApiError, type Problem, requestJson } from "../common/api";
import { button, h } from "../common/dom";
import { caughtErrorCard, errorCard } from "../common/components";
import { fetchOpenApi, objectProperties, type OpenApi, resolve, type Schema } from "../common/openapi";
import { byteSize, duration, number } from "../common/numbers";
import { COPY_AS_CURL } from "../common/strings";
import { copyCommand, tokenHeader } from "../common/curl";
import { createField, type Field, fieldOrder, parameterLabel, requiredNames, setValue, valueOf } from "./form_fields";
import type { JobFeed } from "./job_feed";
import { KINDS } from "./kinds";
import { type PipelineRun, randomKey } from "./pipeline_run";
import { FORM } from "./strings";
import { type Job, title } from "./types";
import type { View } from "./main_view";

// Delay between the last input and its validation.
const VALIDATION_DELAY_MS = 350;

// Longer hints are shown below the field (characters).
const MAX_INLINE_HINT = 70;

export class NewJobForm implements View {
  readonly element = h("article", { class: "new-job" });
  readonly #feed: JobFeed;
  readonly #kinds = h("fieldset", { class: "kinds" });
  readonly #fields = h("div", { class: "fields" });
  readonly #estimate = h("p", { class: "estimate", role: "status" });
  readonly #error = h("div");
  readonly #command = h("code", { class: "command", hidden: true });
  readonly #copyStatus = h("p", { class: "hint copy-status", role: "status" });
  readonly #name = h("input", { type: "text", maxlength: 200, placeholder: FORM.optional });
  readonly #inputs = new Map<string, Field>();
  readonly #query: URLSearchParams;
  readonly #content: HTMLElement[];
  // Parameters of the shown kind, and those that its schema requires.
  #properties: Record<string, Schema> = {};
  #required: string[] = [];
  #api: OpenApi | null = null;
  #kind = Object.keys(KINDS)[0]!;
  #timer = 0;
  #numRequests = 0;
  // Idempotency key of the current input: a request that is repeated after a lost response creates one job.
  #key = randomKey();
  #isClosed = false;
  // The form, or the fields of this kind, could not be built.
  #hasFailed = false;
  #failedKind: string | null = null;

  constructor(feed: JobFeed, pipeline: PipelineRun, query: URLSearchParams) {
    [this.#feed, this.#query] = [feed, query];
    const submit = button(FORM.start, () => this.#submit(), { class: "primary" });
    const copy = button(COPY_AS_CURL, () => this.#copy());
    this.#content = [
      pipeline.panel(),
      this.#kinds,
      h("label", { class: "line" }, h("span", {}, FORM.name), this.#name),
      this.#fields,
      h("p", { class: "hint" }, FORM.required),
      this.#estimate,
      this.#error,
      h("div", { class: "actions" }, submit, copy),
      this.#copyStatus,
      this.#command,
    ];
    this.element.addEventListener("input", () => this.#scheduleValidation());
    void this.#open();
  }

  // Builds the form again if the server was not reachable, otherwise validates the input again.
  retry(): void {
    if (this.#hasFailed) void this.#open();
    else if (this.#failedKind !== null) void this.#changeKind(this.#failedKind);
    else if (this.#api) void this.#validate();
  }

  close(): void {
    this.#isClosed = true;
    clearTimeout(this.#timer);
  }

  async #open(): Promise<void> {
    this.#hasFailed = false;
    this.element.replaceChildren(h("h1", {}, FORM.title), ...this.#content);
    const query = this.#query;
    try {
      this.#api = await fetchOpenApi();
      const clone = query.get("clone");
      const original = clone ? (this.#feed.jobs.get(clone) ?? (await this.#feed.fetch(clone))) : null;
      this.#kind = original?.kind ?? query.get("kind") ?? this.#kind;
      if (original) this.#name.value = FORM.copyOf(title(original));
      this.#kinds.replaceChildren(h("legend", { class: "visually-hidden" }, FORM.kind));
      for (const [value, text] of Object.entries(KINDS)) {
        const input = h("input", { type: "radio", name: "kind", value, change: () => void this.#changeKind(value) });
        input.checked = value === this.#kind;
        this.#kinds.append(h("label", {}, input, text));
      }
      await this.#showFields(this.#kind, original?.params ?? Object.fromEntries(query));
    } catch (error) {
      this.#hasFailed = true;
      this.element.replaceChildren(h("h1", {}, FORM.title), caughtErrorCard(error));
    }
  }

  // Shows the fields of another kind, or the error if its options cannot be fetched.
  async #changeKind(kind: string): Promise<void> {
    this.#failedKind = null;
    try {
      await this.#showFields(kind, {});
    } catch (error) {
      if (this.#kind !== kind) return;
      this.#failedKind = kind;
      this.#inputs.clear();
      this.#fields.replaceChildren();
      this.#showError(error);
    }
  }

  async #showFields(kind: string, values: Record<string, unknown>): Promise<void> {
    this.#kind = kind;
    const { properties, required } = this.#schema(kind);
    const names = Object.keys(properties).sort((a, b) => fieldOrder(a, required) - fieldOrder(b, required));
    const fields = await Promise.all(names.map(async (name) => [name, await createField(this.element, name, properties[name]!)] as const));
    // The user may have chosen another kind meanwhile.
    if (this.#kind !== kind) return;
    [this.#properties, this.#required] = [properties, required];
    this.#inputs.clear();
    this.#fields.replaceChildren();
    for (const [name, input] of fields) {
      setValue(input, values[name]);
      this.#inputs.set(name, input);
      const hint = (properties[name]?.description ?? "").replaceAll("`", "");
      const note = h("small", { class: hint.length > MAX_INLINE_HINT ? "hint is-long" : "hint", id: `hint-${name}` }, hint);
      // The hint is inside the label element but not part of the field's name.
      const text = h("span", { id: `label-${name}` }, parameterLabel(name));
      input.setAttribute("aria-labelledby", text.id);
      input.setAttribute("aria-describedby", note.id);
      this.#fields.append(h("label", { class: "line", "data-param": name }, text, input, note));
    }
    await this.#validate();
  }

  // Schema of the parameters of a kind, which the request states by a constant or a single enum value.
  #schema(kind: string): ReturnType<typeof objectProperties> {
    const api = this.#api!;
    const { JobRequest, JobTask } = api.components.schemas;
    const tasks = [JobRequest, JobTask].flatMap((schema) => schema?.oneOf ?? []).map((task) => objectProperties(api, task).properties);
    const task = tasks.find(({ kind: name }) => name?.enum?.includes(kind) || name?.const === kind);
    return objectProperties(api, task?.["params"] ?? {});
  }

  #body(): Record<string, unknown> {
    const values = [...this.#inputs].map(([name, input]) => [name, valueOf(input, resolve(this.#api!, this.#properties[name] ?? {}))]);
    const params = Object.fromEntries(values.filter(([, value]) => value !== undefined)) as Record<string, unknown>;
    return { kind: this.#kind, params, ...(this.#name.value && { name: this.#name.value }) };
  }

  // Marks the required fields; returns those that are empty.
  #markRequired(): Field[] {
    const required = requiredNames(this.#required, this.#inputs);
    for (const [name, input] of this.#inputs) {
      input.required = required.includes(name);
      input.closest(".line")?.classList.toggle("is-required", input.required);
    }
    return [...this.#inputs.values()].filter((input) => input.required && input.value === "");
  }

  // Name of the parameter of a field.
  #labelOf(field: Field): string {
    const [name] = [...this.#inputs].find(([, input]) => input === field)!;
    return parameterLabel(name);
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
    const missing = this.#markRequired();
    if (missing.length > 0) {
      this.#showError(null);
      this.#estimate.textContent = FORM.missing(missing.map((field) => this.#labelOf(field)));
      return;
    }
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
      this.#error.replaceChildren(problem?.errors ? invalidInputCard(problem, this.#inputs) : caughtErrorCard(error));
    }
  }

  async #submit(): Promise<void> {
    // Cancels pending validation.
    clearTimeout(this.#timer);
    const missing = this.#markRequired();
    if (missing.length > 0) {
      await this.#validate();
      for (const field of missing) field.setAttribute("aria-invalid", "true");
      return missing[0]!.focus();
    }
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

// Card of a rejected parameter, in the words of the form. The hint is omitted: it refers to the API.
function invalidInputCard({ errors, code, request_id }: Problem, inputs: ReadonlyMap<string, Field>): HTMLElement {
  const inForm = (name: string) => (inputs.has(name) ? parameterLabel(name) : name);
  const sentences = (errors ?? []).map(({ param, detail }) => {
    const name = param.split(".").pop()!;
    const text = detail.replace(`${param}: `, "").replaceAll(/\b[a-z0-9]+(_[a-z0-9]+)+\b/g, inForm);
    return `${parameterLabel(name)}: ${text}.`;
  });
  return errorCard(sentences.join(" "), "", [code, request_id].filter(Boolean).join(" "));
}
