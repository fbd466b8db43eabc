// Self-check of the browser features that the page uses, each with a hint; opened by ?check or from the
// footer.

import { h, withCode } from "../../common/dom";
import { VIDEO_FORMAT } from "../files/video_format";
import { CHECK } from "./strings";

interface Feature {
  name: string;
  // Whether the page works without it.
  isOptional?: boolean;
  isAvailable: boolean;
  detail: string;
  hint: string;
}

// Module with a function that adds two v128 values; it validates only with SIMD support.
const SIMD = new Uint8Array([
  0, 97, 115, 109, 1, 0, 0, 0, 1, 5, 1, 96, 0, 1, 123, 3, 2, 1, 0, 10, 10, 1, 8, 0, 65, 0, 253, 15, 253, 98, 11,
]);

function detectFeatures(): Feature[] {
  const context = document.createElement("canvas").getContext("webgl2");
  const renderer = context?.getExtension("WEBGL_debug_renderer_info");
  const graphics = context && renderer ? String(context.getParameter(renderer.UNMASKED_RENDERER_WEBGL)) : "";
  context?.getExtension("WEBGL_lose_context")?.loseContext();
  const memory = (navigator as { deviceMemory?: number }).deviceMemory;
  return [
    { ...CHECK.webAssembly, isAvailable: typeof WebAssembly === "object", detail: "" },
    { ...CHECK.simd, isAvailable: typeof WebAssembly === "object" && WebAssembly.validate(SIMD), detail: "" },
    { ...CHECK.workers, isAvailable: typeof Worker === "function", detail: CHECK.cores(navigator.hardwareConcurrency) },
    { ...CHECK.webgl, isAvailable: context !== null, detail: graphics },
    { ...CHECK.storage, isAvailable: typeof indexedDB === "object", detail: "" },
    { ...CHECK.isolation, isAvailable: crossOriginIsolated },
    { ...CHECK.memory, isAvailable: memory === undefined || memory >= 2, detail: memory ? CHECK.gigabytes(memory) : "" },
    { ...CHECK.video, isAvailable: VIDEO_FORMAT !== undefined, detail: "" },
  ];
}

export function showBrowserCheck(): void {
  const row = ({ name, isOptional, isAvailable, detail, hint }: Feature) => {
    const text = isAvailable ? [detail || CHECK.available] : withCode(isOptional ? CHECK.optional(hint) : hint);
    const state = isAvailable ? "is-good" : isOptional ? "is-optional" : "is-bad";
    return h("li", { class: state }, h("b", {}, name), h("span", {}, ...text));
  };
  const features = detectFeatures();
  const missing = features.filter(({ isAvailable }) => !isAvailable);
  const required = missing.filter(({ isOptional }) => !isOptional);
  const summary =
    required.length > 0 ? CHECK.missing(required.length) : missing.length > 0 ? CHECK.optionalMissing(missing.length) : CHECK.supported;
  const dialog = h(
    "dialog",
    { class: "check", "aria-label": CHECK.title },
    h("h2", {}, summary),
    h("ul", {}, ...features.map(row)),
    h("form", { method: "dialog" }, h("button", { class: "primary" }, CHECK.close)),
  );
  dialog.addEventListener("close", () => dialog.remove());
  document.body.append(dialog);
  dialog.showModal();
}
