// A new job: a form made from what the server says of its parameters, checked and estimated while it is filled in.

import { API, ask, Refused } from "../common/api";
import { button, h } from "../common/dom";
import { refusal } from "../common/parts";
import { type Description, describe, members, type Schema } from "../common/openapi";
import { duration, label, number, size } from "../common/numbers";
import { COPY_AS_CURL } from "../common/strings";
import { copyCommand, tokenHeader } from "../common/curl";
import type { Feed } from "./feed";
import { everyPage } from "./pages";
import { DATASETS, FORM, KINDS, PARAMETERS } from "./strings";
import { type Job, title } from "./types";
import type { View } from "./view";

type Field = HTMLInputElement | HTMLSelectElement;

// Typing that stops for so long is checked (ms).
const PAUSE = 350;

// Hints with more letters stand below.
const LONG = 70;

type ListedRecord = { id: string } & Record<string, unknown>;

// Which records a parameter may name.
const RECORDS: Record<string, { path: string; label: (record: ListedRecord) => string }> = {
  dataset_id: { path: "datasets", label: ({ id, config }) => `${String(id)}, ${preset(config)}` },
  encoder_id: { path: "models", label: modelLabel },
  model_id: { path: "models", label: modelLabel },
  mesh_id: { path: "meshes", label: ({ name }) => String(name) },
};

export class NewJob implements View {
  readonly element = h("article", { class: "new-job" }, h("h1", {}, FORM.title));
  readonly #feed: Feed;
  readonly #kinds = h("fieldset", { class: "kinds" }, h("legend", { class: "visually-hidden" }, FORM.whatToDo));
  readonly #fields = h("div", { class: "fields" });
  readonly #estimate = h("p", { class: "estimate", role: "status" });
  readonly #problem = h("div");
  readonly #command = h("code", { class: "command", hidden: true });
  readonly #told = h("p", { class: "hint told", role: "status" });
  readonly #name = h("input", { type: "text", maxlength: 200, placeholder: FORM.forPeople });
  readonly #inputs = new Map<string, Field>();
  #description: Description | null = null;
  #kind = Object.keys(KINDS)[0]!;
  #timer = 0;
  #asked = 0;
  // Names what stands here: asked for twice, because an answer was lost, it is one job.
  #key = newKey();
  #isClosed = false;

  constructor(feed: Feed, query: URLSearchParams) {
    this.#feed = feed;
    const submit = button(FORM.begin, () => this.#begin(), { class: "primary" });
    const copy = button(COPY_AS_CURL, () => this.#copy());
    this.element.append(
      this.#kinds,
      h("label", { class: "line" }, h("span", {}, FORM.name), this.#name),
      this.#fields,
      this.#estimate,
      this.#problem,
      h("div", { class: "actions" }, submit, copy),
      this.#told,
      this.#command,
    );
    this.element.addEventListener("input", () => this.#later());
    void this.#open(query);
  }

  close(): void {
    this.#isClosed = true;
    clearTimeout(this.#timer);
  }

  async #open(query: URLSearchParams): Promise<void> {
    try {
      this.#description = await describe();
      const clone = query.get("clone");
      const like = clone ? (this.#feed.jobs.get(clone) ?? (await this.#feed.fetch(clone))) : null;
      this.#kind = like?.kind ?? query.get("kind") ?? this.#kind;
      if (like) this.#name.value = FORM.changed(title(like));
      for (const [value, text] of Object.entries(KINDS)) {
        const input = h("input", { type: "radio", name: "kind", value, change: () => void this.#change(value) });
        input.checked = value === this.#kind;
        this.#kinds.append(h("label", {}, input, text));
      }
      await this.#choose(this.#kind, like?.params ?? Object.fromEntries(query));
    } catch (error) {
      this.element.replaceChildren(h("h1", {}, FORM.title), refusal(error));
    }
  }

  // Another kind; where what it needs cannot be fetched, there is nothing to fill in.
  async #change(kind: string): Promise<void> {
    try {
      await this.#choose(kind, {});
    } catch (error) {
      if (this.#kind !== kind) return;
      this.#inputs.clear();
      this.#fields.replaceChildren();
      this.#blame(error);
    }
  }

  async #choose(kind: string, values: Record<string, unknown>): Promise<void> {
    this.#kind = kind;
    const { properties, required } = this.#schema(kind);
    const names = Object.keys(properties).sort((a, b) => order(a, required) - order(b, required));
    const made = await Promise.all(names.map(async (name) => [name, await this.#field(name, properties[name]!)] as const));
    // Another kind was chosen meanwhile.
    if (this.#kind !== kind) return;
    this.#inputs.clear();
    this.#fields.replaceChildren();
    for (const [name, input] of made) {
      const value = values[name];
      if (value != null) {
        if (input instanceof HTMLInputElement && input.type === "checkbox") input.checked = value === true;
        else input.value = String(value);
      }
      this.#inputs.set(name, input);
      const hint = (properties[name]?.description ?? "").replaceAll("`", "");
      const note = h("small", { class: hint.length > LONG ? "hint is-long" : "hint", id: `hint-${name}` }, hint);
      // The hint lies in the label, and is not its name.
      const words = h("span", { id: `label-${name}` }, PARAMETERS[name] ?? label(name));
      input.setAttribute("aria-labelledby", words.id);
      input.setAttribute("aria-describedby", note.id);
      this.#fields.append(h("label", { class: "line", "data-param": name }, words, input, note));
    }
    await this.#check();
  }

  #schema(kind: string): ReturnType<typeof members> {
    const description = this.#description!;
    const tasks = description.components.schemas["JobTask"]?.oneOf ?? [];
    const task = tasks.find(({ properties }) => properties?.["kind"]?.enum?.includes(kind));
    return members(description, task?.properties?.["params"] ?? {});
  }

  async #field(name: string, schema: Schema): Promise<Field> {
    const types = [schema.type ?? []].flat();
    const records = RECORDS[name];
    if (records || schema.enum) {
      const options = records ? await recordsOf(name, records) : schema.enum!.map((one): [string, string] => [one, label(one)]);
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

  #request(): Record<string, unknown> {
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

  #later(): void {
    // What was copied is no longer what stands here.
    this.#command.hidden = true;
    this.#told.textContent = "";
    this.#key = newKey();
    clearTimeout(this.#timer);
    this.#timer = window.setTimeout(() => void this.#check(), PAUSE);
  }

  // What the server would make of it.
  async #check(): Promise<void> {
    const asked = ++this.#asked;
    try {
      const job = await ask<Job>("jobs?dry_run=true", "POST", this.#request(), { isQuiet: true });
      if (asked !== this.#asked) return;
      this.#blame(null);
      for (const [name, input] of this.#inputs) {
        const resolved = job.params[name];
        if (input instanceof HTMLInputElement) input.placeholder = typeof resolved === "number" ? number(resolved) : "";
      }
      const { seconds, bytes } = job.estimate ?? {};
      const parts = [seconds && FORM.about(duration(seconds)), bytes && FORM.disk(size(bytes))].filter((part) => typeof part === "string");
      this.#estimate.textContent = parts.length > 0 ? FORM.takes(parts) : "";
    } catch (error) {
      if (asked !== this.#asked) return;
      const wantsToken = error instanceof Refused && error.problem.status === 401;
      this.#blame(wantsToken ? null : error);
      if (wantsToken) this.#estimate.textContent = FORM.tokenFirst;
    }
  }

  // Marks the parameter that is wrong and says why.
  #blame(error: unknown): void {
    this.#problem.replaceChildren();
    const problem = error instanceof Refused ? error.problem : null;
    const params = problem?.errors?.map(({ param }) => param.split(".").pop()) ?? [];
    for (const [name, input] of this.#inputs) {
      const isBad = params.includes(name);
      input.setAttribute("aria-invalid", String(isBad));
    }
    if (error) {
      this.#estimate.textContent = "";
      this.#problem.replaceChildren(refusal(error));
    }
  }

  async #begin(): Promise<void> {
    // What is being checked has been decided.
    clearTimeout(this.#timer);
    this.#asked += 1;
    try {
      const job = await ask<Job>("jobs", "POST", this.#request(), { headers: { "Idempotency-Key": this.#key } });
      this.#feed.put(job);
      this.#key = newKey();
      // Whoever has gone on finds it in the list.
      if (!this.#isClosed) location.hash = `#jobs/${job.id}`;
    } catch (error) {
      this.#blame(error);
    }
  }

  async #copy(): Promise<void> {
    const body = JSON.stringify(this.#request()).replaceAll("'", "'\\''");
    this.#command.textContent = `curl -fsS${tokenHeader()} -d '${body}' ${new URL("jobs", API).href}`;
    this.#command.hidden = false;
    this.#told.textContent = await copyCommand(this.#command);
  }
}

// Not randomUUID, which a page that came over plain http does not have.
function newKey(): string {
  return [...crypto.getRandomValues(new Uint32Array(4))].map((part) => part.toString(36)).join("-");
}

// What must be given comes first, threads and seeds last.
function order(name: string, required: string[]): number {
  if (required.includes(name)) return 0;
  const first = ["preset", "policy", "object", "mesh_id", "mass_kg", "density_kg_m3", "attempts", "controls", "steps"].indexOf(name);
  const last = ["checkpoint", "threads", "seed"].indexOf(name);
  return last >= 0 ? 50 + last : first >= 0 ? 1 + first : 20;
}

async function recordsOf(name: string, { path, label: text }: (typeof RECORDS)[string]): Promise<[string, string][]> {
  const all = await everyPage<ListedRecord>(path);
  // An encoder alone does not act.
  const fit = name === "model_id" ? all.filter(({ kind }) => kind !== "encoder") : all;
  const records = fit.map((record): [string, string] => [record.id, text(record)]);
  return name === "model_id" ? [...records, ["planner", FORM.planner]] : records;
}

function modelLabel({ id, kind, step }: Record<string, unknown>): string {
  return [String(id), kind, step == null ? null : FORM.step(String(step))].filter(Boolean).join(", ");
}

function preset(config: unknown): string {
  const objects = (config as { objects?: string[] } | undefined)?.objects ?? [];
  return objects.length > 3 ? DATASETS.objects(objects.length) : objects.map(label).join(", ");
}
