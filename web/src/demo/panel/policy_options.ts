// Options of policy selection lists. The list of models is fetched when a select element gets the focus.

import { h } from "../../common/dom";

export function fillOnFocus(select: HTMLSelectElement): void {
  const fill = () => void addModels(select);
  select.addEventListener("pointerdown", fill);
  select.addEventListener("focus", fill);
}

// Adds an option unless it exists.
export function addOption(select: HTMLSelectElement, id: string): void {
  const exists = [...select.options].some(({ value }) => value === id);
  if (!exists) select.append(h("option", { value: id }, id));
}

async function addModels(select: HTMLSelectElement): Promise<void> {
  // From the server's API. A static host has the list of the models that were built into the site.
  const models = (await fetchModels("api/v1/models")) ?? (await fetchModels("models/index.json")) ?? [];
  for (const { id, kind } of models) if (kind !== "encoder") addOption(select, id);
}

async function fetchModels(url: string): Promise<{ id: string; kind?: string }[] | null> {
  try {
    const response = await fetch(url);
    return response.ok ? ((await response.json()) as { data: { id: string; kind?: string }[] }).data : null;
  } catch {
    return null;
  }
}
