// Puts the models beside the page, for hosts that serve files and nothing else;
// `ngf serve` has its own.

import { copyFile, mkdir, readdir, readFile, stat, writeFile } from "node:fs/promises";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import type { Plugin } from "vite";

const FILES = { weights: "weights.safetensors", starts: "starts.safetensors", config: "config.json" };

export function models(): Plugin {
  const from = fileURLToPath(new URL("../models", import.meta.url));
  let folder = "";
  return {
    name: "models",
    apply: "build",
    configResolved(config) {
      folder = join(config.root, config.build.outDir, "models");
    },
    async writeBundle() {
      const found = await readdir(from, { withFileTypes: true });
      const ids = found.filter((entry) => entry.isDirectory()).map(({ name }) => name).sort();
      const data = await Promise.all(ids.map((id) => copied(join(from, id), folder, id)));
      await writeFile(join(folder, "index.json"), JSON.stringify({ data }));
    },
  };
}

// Copies a model; gives what the list says of it.
async function copied(from: string, folder: string, id: string): Promise<object> {
  const files: Record<string, { url: string; bytes: number }> = {};
  await mkdir(join(folder, id), { recursive: true });
  for (const [name, file] of Object.entries(FILES)) {
    await copyFile(join(from, file), join(folder, id, file));
    files[name] = { url: `models/${id}/${file}`, bytes: (await stat(join(from, file))).size };
  }
  const card: unknown = JSON.parse(await readFile(join(from, "card.json"), "utf8"));
  return { id, files, card };
}
