// The policies that there are: a choice is filled with them whenever somebody wants it.

import { h } from "../common/dom";

export function fillWhenWanted(choice: HTMLSelectElement): void {
  const fill = () => void list(choice);
  choice.addEventListener("pointerdown", fill);
  choice.addEventListener("focus", fill);
}

// Adds what is not there yet.
export function offer(choice: HTMLSelectElement, id: string): void {
  const known = [...choice.options].some(({ value }) => value === id);
  if (!known) choice.append(h("option", { value: id }, id));
}

async function list(choice: HTMLSelectElement): Promise<void> {
  // Of the server, or, where only files are served, those that lie beside the page.
  const models = (await modelsAt("api/v1/models")) ?? (await modelsAt("models/index.json")) ?? [];
  for (const { id, kind } of models) if (kind !== "encoder") offer(choice, id);
}

async function modelsAt(address: string): Promise<{ id: string; kind?: string }[] | null> {
  try {
    const answer = await fetch(address);
    return answer.ok ? ((await answer.json()) as { data: { id: string; kind?: string }[] }).data : null;
  } catch {
    return null;
  }
}
