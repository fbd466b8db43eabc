import { fileURLToPath } from "node:url";
import { defineConfig } from "vite";
import { compressed } from "./compressed.ts";

export default defineConfig({
  // The bindings that `cargo xtask` writes.
  resolve: { alias: { engine: fileURLToPath(new URL("engine", import.meta.url)) } },
  build: {
    target: "es2022",
    // Every file is a file of its own: the content security policy allows no data: scripts.
    assetsInlineLimit: 0,
    modulePreload: { polyfill: false },
    chunkSizeWarningLimit: 800,
  },
  worker: { format: "es" },
  plugins: [compressed()],
});
