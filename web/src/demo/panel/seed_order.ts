// Order of the attempts of a batch. Several workers execute the seeds, so attempts do not end in their order.

// Inserts the element of an attempt after those of lower and equal seeds.
export function insertBySeed(parent: Element, child: HTMLElement | SVGElement, seed: number): void {
  child.dataset["seed"] = String(seed);
  const isLater = (other: Element) => Number(other.getAttribute("data-seed") ?? -1) > seed;
  parent.insertBefore(child, [...parent.children].find(isLater) ?? null);
}
