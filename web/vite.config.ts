import { fileURLToPath } from "node:url";
import { defineConfig } from "vite";
import { compressed } from "./compressed.ts";
import { models } from "./models.ts";

const here = (path: string) => fileURLToPath(new URL(path, import.meta.url));

export default defineConfig({
  // Any folder of any host will do.
  base: "./",
  // The bindings that `cargo xtask` writes.
  resolve: { alias: { engine: here("engine") } },
  build: {
    target: "es2022",
    // Every file is a file of its own: the content security policy allows no data: scripts.
    assetsInlineLimit: 0,
    modulePreload: { polyfill: false },
    chunkSizeWarningLimit: 800,
    rolldownOptions: {
      checks: { pluginTimings: false },
      input: { demo: here("index.html"), jobs: here("jobs/index.html"), docs: here("docs/index.html") },
    },
  },
  worker: { format: "es" },
  plugins: [models(), compressed()],
});
