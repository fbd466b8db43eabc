// Vite plugin: copies the models into the site, for hosts that serve only static files. `ngf serve` has its
// own.

import { copyFile, mkdir, readdir, readFile, stat, writeFile } from "node:fs/promises";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import type { Plugin } from "vite";
import { MODEL_FILES } from "../src/common/constants.ts";

export function copyModels(): Plugin {
  const source = fileURLToPath(new URL("../../models", import.meta.url));
  let target = "";
  return {
    name: "copy-models",
    apply: "build",
    configResolved(config) {
      target = join(config.root, config.build.outDir, "models");
    },
    async writeBundle() {
      const entries = await readdir(source, { withFileTypes: true });
      const ids = entries.filter((entry) => entry.isDirectory()).map(({ name }) => name).sort();
      const data = await Promise.all(ids.map((id) => copyModel(join(source, id), target, id)));
      await writeFile(join(target, "index.json"), JSON.stringify({ data }));
    },
  };
}

// Copies one model and returns its entry of index.json.
async function copyModel(source: string, target: string, id: string): Promise<object> {
  const files: Record<string, { url: string; bytes: number }> = {};
  await mkdir(join(target, id), { recursive: true });
  for (const [name, file] of Object.entries(MODEL_FILES)) {
    await copyFile(join(source, file), join(target, id, file));
    files[name] = { url: `models/${id}/${file}`, bytes: (await stat(join(source, file))).size };
  }
  const card: unknown = JSON.parse(await readFile(join(source, "card.json"), "utf8"));
  return { id, files, card };
}
