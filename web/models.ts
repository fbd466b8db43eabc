// Puts the default model beside the page, for hosts that serve files and nothing else; `ngf serve` has its own.

import { copyFile, mkdir, readFile, stat, writeFile } from "node:fs/promises";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import type { Plugin } from "vite";

const ID = "default";
const FILES = { weights: "weights.safetensors", starts: "starts.safetensors", config: "config.json" };

export function models(): Plugin {
  const from = fileURLToPath(new URL(`../models/${ID}`, import.meta.url));
  let folder = "";
  return {
    name: "models",
    apply: "build",
    configResolved(config) {
      folder = join(config.root, config.build.outDir, "models");
    },
    async writeBundle() {
      const files: Record<string, { url: string; bytes: number }> = {};
      await mkdir(join(folder, ID), { recursive: true });
      for (const [name, file] of Object.entries(FILES)) {
        await copyFile(join(from, file), join(folder, ID, file));
        files[name] = { url: `models/${ID}/${file}`, bytes: (await stat(join(from, file))).size };
      }
      const card: unknown = JSON.parse(await readFile(join(from, "card.json"), "utf8"));
      await writeFile(join(folder, "index.json"), JSON.stringify({ data: [{ id: ID, files, card }] }));
    },
  };
}
