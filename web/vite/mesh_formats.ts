// Vite plugin: replaces %MESH_FORMATS% and %MESH_EXTENSIONS% in HTML files.

import type { Plugin } from "vite";
import { MESH_EXTENSIONS, MESH_FORMATS } from "../src/common/constants.ts";

export function meshFormats(): Plugin {
  const extensions = MESH_EXTENSIONS.map((name) => `.${name}`).join();
  return {
    name: "mesh-formats",
    transformIndexHtml: (html) =>
      html.replaceAll("%MESH_FORMATS%", MESH_FORMATS).replaceAll("%MESH_EXTENSIONS%", extensions),
  };
}
