// What this browser can do of what the page needs, each with a cure: ?check, or from the list of keys.

import { h } from "../common/dom";

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
  const update = "Use Chrome 111, Firefox 121, Safari 16.4 or newer.";
  return [
    { name: "WebAssembly", works: typeof WebAssembly === "object", told: "", cure: update },
    { name: "SIMD", works: WebAssembly.validate(SIMD), told: "", cure: update },
    { name: "Workers", works: typeof Worker === "function", told: `${navigator.hardwareConcurrency} cores`, cure: update },
    {
      name: "WebGL 2",
      works: context !== null,
      told: graphics,
      cure: "Turn on hardware acceleration. Without it nothing is drawn, but attempts run and verdicts are told.",
    },
    { name: "Isolation", works: crossOriginIsolated, told: "precise clocks", cure: "The host must send COOP and COEP, as `ngf serve` does. It works without, too." },
    { name: "Memory", works: memory === undefined || memory >= 2, told: memory ? `${memory} GB or more` : "", cure: "Close other pages." },
    { name: "Film", works: "MediaRecorder" in window, told: "", cure: "Record the screen instead." },
  ];
}

export function showCheck(): void {
  const row = ({ name, works, told, cure }: Finding) =>
    h("li", { class: works ? "is-good" : "is-bad" }, h("b", {}, name), h("span", {}, works ? told || "works" : cure));
  const all = findings();
  const bad = all.filter(({ works }) => !works).length;
  const dialog = h(
    "dialog",
    { class: "check", "aria-label": "Self-check" },
    h("h2", {}, bad === 0 ? "This browser can do all of it" : `${bad} of ${all.length} are missing`),
    h("ul", {}, ...all.map(row)),
    h("form", { method: "dialog" }, h("button", { class: "primary" }, "Close")),
  );
  dialog.addEventListener("close", () => dialog.remove());
  document.body.append(dialog);
  dialog.showModal();
}
