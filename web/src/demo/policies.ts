// The policies that there are: a choice is filled with them when somebody wants it.

import { h } from "../common/dom";

export function fillWhenWanted(choice: HTMLSelectElement): void {
  const fill = () => void list(choice);
  choice.addEventListener("pointerdown", fill, { once: true });
  choice.addEventListener("focus", fill, { once: true });
}

// Adds what is not there yet.
export function offer(choice: HTMLSelectElement, id: string): void {
  const known = [...choice.options].some(({ value }) => value === id);
  if (!known) choice.append(h("option", { value: id }, id));
}

async function list(choice: HTMLSelectElement): Promise<void> {
  const answer = await fetch("api/v1/models").catch(() => null);
  if (!answer?.ok) return;
  const { data } = (await answer.json()) as { data: { id: string; kind?: string }[] };
  for (const { id, kind } of data) if (kind !== "encoder") offer(choice, id);
}
