// Options of policy selection lists. The list of models is fetched once the first policy is loaded, and again when a
// select element gets the focus.

import { h } from "../../common/dom";
import type { EventBus } from "../app/event_bus";

type Models = { id: string; kind?: string }[];

// Request in progress, shared by the lists.
let request: Promise<Models> | null = null;

export function fillWithModels(select: HTMLSelectElement, bus: EventBus): void {
  const fill = () => void addModels(select);
  let isFilled = false;
  bus.on("model", () => {
    if (!isFilled) fill();
    isFilled = true;
  });
  select.addEventListener("pointerdown", fill);
  select.addEventListener("focus", fill);
}

// Adds an option unless it exists.
export function addOption(select: HTMLSelectElement, id: string): void {
  const exists = [...select.options].some(({ value }) => value === id);
  if (!exists) select.append(h("option", { value: id }, id));
}

async function addModels(select: HTMLSelectElement): Promise<void> {
  request ??= fetchAllModels().finally(() => (request = null));
  for (const { id, kind } of await request) if (kind !== "encoder") addOption(select, id);
}

// From the server's API. A static host has the list of the models that were built into the site.
async function fetchAllModels(): Promise<Models> {
  return (await fetchModels("api/v1/models")) ?? (await fetchModels("models/index.json")) ?? [];
}

async function fetchModels(url: string): Promise<Models | null> {
  try {
    const response = await fetch(url);
    return response.ok ? ((await response.json()) as { data: Models }).data : null;
  } catch {
    return null;
  }
}
