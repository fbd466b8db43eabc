// What this browser can do of what the page needs, each with a cure: ?check, or from the list of keys.

import { h } from "../common/dom";
import { FILM } from "./film";
import { CHECK } from "./strings";

interface Finding {
  name: string;
  works: boolean;
  told: string;
  cure: string;
}

// A function that adds two vectors of four: it compiles where there is SIMD.
const SIMD = new Uint8Array([
  0, 97, 115, 109, 1, 0, 0, 0, 1, 5, 1, 96, 0, 1, 123, 3, 2, 1, 0, 10, 10, 1, 8, 0, 65, 0, 253, 15, 253, 98, 11,
]);

function findings(): Finding[] {
  const context = document.createElement("canvas").getContext("webgl2");
  const renderer = context?.getExtension("WEBGL_debug_renderer_info");
  const graphics = context && renderer ? String(context.getParameter(renderer.UNMASKED_RENDERER_WEBGL)) : "";
  context?.getExtension("WEBGL_lose_context")?.loseContext();
  const memory = (navigator as { deviceMemory?: number }).deviceMemory;
  return [
    { ...CHECK.webAssembly, works: typeof WebAssembly === "object", told: "" },
    { ...CHECK.simd, works: typeof WebAssembly === "object" && WebAssembly.validate(SIMD), told: "" },
    { ...CHECK.workers, works: typeof Worker === "function", told: CHECK.cores(navigator.hardwareConcurrency) },
    { ...CHECK.webgl, works: context !== null, told: graphics },
    { ...CHECK.storage, works: typeof indexedDB === "object", told: "" },
    { ...CHECK.isolation, works: crossOriginIsolated },
    { ...CHECK.memory, works: memory === undefined || memory >= 2, told: memory ? CHECK.gigabytes(memory) : "" },
    { ...CHECK.film, works: FILM !== undefined, told: "" },
  ];
}

export function showCheck(): void {
  const row = ({ name, works, told, cure }: Finding) =>
    h("li", { class: works ? "is-good" : "is-bad" }, h("b", {}, name), h("span", {}, works ? told || CHECK.works : cure));
  const all = findings();
  const bad = all.filter(({ works }) => !works).length;
  const dialog = h(
    "dialog",
    { class: "check", "aria-label": CHECK.title },
    h("h2", {}, bad === 0 ? CHECK.allWork : CHECK.missing(bad, all.length)),
    h("ul", {}, ...all.map(row)),
    h("form", { method: "dialog" }, h("button", { class: "primary" }, CHECK.close)),
  );
  dialog.addEventListener("close", () => dialog.remove());
  document.body.append(dialog);
  dialog.showModal();
}
