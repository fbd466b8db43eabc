// Fields of the job form: one input per parameter of the server's schema, with options, defaults and values.

import { h } from "../common/dom";
import { label } from "../common/numbers";
import type { Schema } from "../common/openapi";
import { fetchAll } from "./paginated_table";
import { DATASETS, FORM, PARAMETERS } from "./strings";

export type Field = HTMLInputElement | HTMLSelectElement;

type ServerRecord = { id: string; kind?: string; step?: number | null; created_at?: string } & Record<string, unknown>;

// Parameters that refer to a record: list path, option text, and the records of which the newest is preselected.
interface RecordParameter {
  path: string;
  label(record: ServerRecord): string;
  isPreferred(record: ServerRecord): boolean;
}

const RECORDS: Record<string, RecordParameter> = {
  dataset_id: { path: "datasets", label: ({ id, config }) => `${id}, ${datasetObjects(config)}`, isPreferred: () => true },
  encoder_id: { path: "models", label: modelLabel, isPreferred: ({ kind }) => kind === "encoder" },
  // A finished policy instead of a checkpoint.
  model_id: { path: "models", label: modelLabel, isPreferred: ({ kind, step }) => kind !== "encoder" && step == null },
  mesh_id: { path: "meshes", label: ({ name }) => String(name), isPreferred: () => false },
};

// Name of a parameter on the page.
export function parameterLabel(name: string): string {
  return PARAMETERS[name] ?? label(name);
}

// Input of a parameter. `form` holds the list of examples of a text field.
export async function createField(form: HTMLElement, name: string, schema: Schema): Promise<Field> {
  const types = [schema.type ?? []].flat();
  const records = RECORDS[name];
  if (records) return recordSelect(name, records, types.includes("null"));
  if (schema.enum) {
    const select = selectOf(schema.enum.map((value) => [value, label(value)]), types.includes("null"));
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
  form.append(list);
  return h("input", { type: "text", list: list.id, autocomplete: "off" });
}

function selectOf(options: [string, string][], isNullable: boolean): HTMLSelectElement {
  const select = h("select");
  if (isNullable) select.append(h("option", { value: "" }, FORM.noChoice));
  for (const [value, text] of options) select.append(h("option", { value }, text));
  return select;
}

// The newest preferred record is preselected: usually the result of the previous job.
async function recordSelect(name: string, parameter: RecordParameter, isNullable: boolean): Promise<HTMLSelectElement> {
  const all = await fetchAll<ServerRecord>(parameter.path);
  // An encoder is not a policy.
  const records = name === "model_id" ? all.filter(({ kind }) => kind !== "encoder") : all;
  const options = records.map((record): [string, string] => [record.id, parameter.label(record)]);
  const select = selectOf(name === "model_id" ? [...options, ["planner", FORM.planner]] : options, isNullable);
  const newest = records
    .filter((record) => record.created_at !== undefined && parameter.isPreferred(record))
    .reduce<ServerRecord | null>((newest, next) => (newest && newest.created_at! >= next.created_at! ? newest : next), null);
  if (newest) select.value = newest.id;
  return select;
}

// Sets the value of a field; null keeps the default.
export function setValue(input: Field, value: unknown): void {
  if (value == null) return;
  if (input instanceof HTMLInputElement && input.type === "checkbox") input.checked = value === true;
  else input.value = String(value);
}

// Value of a field for a request; undefined if it is empty. Display names of examples are replaced by their ids.
export function valueOf(input: Field, { examples = [] }: Schema): unknown {
  if (input instanceof HTMLSelectElement) return input.value || undefined;
  if (input.type === "checkbox") return input.checked || undefined;
  if (input.value === "") return undefined;
  return input.type === "number" ? input.valueAsNumber : identifierOf(input.value, examples);
}

// Identifier of a display name: "Sugar box" is "sugar_box", with a shape variant "sugar_box.2". Other texts stay.
function identifierOf(text: string, identifiers: readonly string[]): string {
  const identifier = text.trim().toLowerCase().replace(/[\s-]+/g, "_");
  return identifiers.includes(identifier.split(".")[0]!) ? identifier : text;
}

// Names of the parameters that must be given: those of the schema, an object or a mesh where neither a preset nor a
// dataset has objects, and the mass of a mesh.
export function requiredNames(required: readonly string[], inputs: ReadonlyMap<string, Field>): string[] {
  const isEmpty = (name: string) => inputs.get(name)?.value === "";
  const hasObjects = inputs.has("preset") || inputs.has("dataset_id");
  const needsObject = inputs.has("object") && !hasObjects && isEmpty("mesh_id");
  const needsMass = inputs.has("mesh_id") && inputs.has("mass_kg") && !isEmpty("mesh_id") && isEmpty("density_kg_m3");
  return [...required, ...(needsObject ? ["object"] : []), ...(needsMass ? ["mass_kg"] : [])];
}

// Sort key of a field: required parameters first, threads and seed last.
export function fieldOrder(name: string, required: readonly string[]): number {
  if (required.includes(name)) return 0;
  const first = ["preset", "policy", "object", "mesh_id", "mass_kg", "density_kg_m3", "attempts", "controls", "steps"].indexOf(name);
  const last = ["checkpoint_every", "threads", "seed"].indexOf(name);
  return last >= 0 ? 50 + last : first >= 0 ? 1 + first : 20;
}

function modelLabel({ id, kind, step }: ServerRecord): string {
  return [id, kind, step == null ? null : FORM.step(String(step))].filter(Boolean).join(", ");
}

function datasetObjects(config: unknown): string {
  const objects = (config as { objects?: string[] } | undefined)?.objects ?? [];
  return objects.length > 3 ? DATASETS.objects(objects.length) : objects.map(label).join(", ");
}
