// Parameters of the page's URL: ?model=ID, with &training=JOB for a running training; ?mesh=ID or
// ?episode=DATASET/INDEX. A share link in the fragment takes precedence.

import { httpStatus } from "../../common/strings";
import type { ShareLink } from "../share/share_link";
import type { Progress } from "../worker/protocol";

export interface UrlParams {
  model: string;
  // Whether the URL or the link names the model.
  isModelRequested: boolean;
  // Job that trains the model; its new checkpoints are loaded.
  training: string | null;
  // Whether a mesh or a demonstration is requested.
  hasFile: boolean;
  // Whether that file is a demonstration, which is replayed.
  isPlayback: boolean;
  // Fetches the mesh or demonstration; null if none is requested.
  fetchFile(onProgress: (progress: Progress) => void): Promise<File | null>;
}

export function parseUrl(link: ShareLink | null, search = location.search): UrlParams {
  const query = new URLSearchParams(search);
  const [mesh, episode] = [query.get("mesh") ?? link?.mesh ?? null, query.get("episode")];
  return {
    model: link?.model ?? query.get("model") ?? "default",
    isModelRequested: link !== null || query.has("model"),
    training: (!link && query.get("training")) || null,
    hasFile: mesh !== null || episode !== null,
    isPlayback: mesh === null && episode !== null,
    fetchFile: async (onProgress) => {
      if (mesh !== null) return fetchMesh(`meshes/${encodeURIComponent(mesh)}`, onProgress);
      if (episode === null) return null;
      const [dataset = "", index = ""] = episode.split("/").map(encodeURIComponent);
      const name = `${dataset}-${index}.json`;
      return readFile(await get(`datasets/${dataset}/episodes/${index}`), name, onProgress);
    },
  };
}

async function fetchMesh(path: string, onProgress: (progress: Progress) => void): Promise<File> {
  const { name } = (await (await get(path)).json()) as { name: string };
  return readFile(await get(`${path}/file`), name, onProgress);
}

// Reads the body of a response as a file and reports the progress.
async function readFile(response: Response, name: string, onProgress: (progress: Progress) => void): Promise<File> {
  const chunks: Uint8Array<ArrayBuffer>[] = [];
  // The Content-Length of a compressed body is not the size of the file.
  const length = response.headers.has("Content-Encoding") ? null : response.headers.get("Content-Length");
  const total = length === null ? null : Number(length);
  const progress = { kind: "progress", label: name, total, unit: "bytes" } as const;
  let done = 0;
  try {
    for (const reader = response.body!.getReader(); ; ) {
      const chunk = await reader.read();
      if (chunk.done) return new File(chunks, name);
      chunks.push(chunk.value);
      done += chunk.value.length;
      onProgress({ ...progress, done, finished: false });
    }
  } finally {
    onProgress({ ...progress, done, finished: true });
  }
}

async function get(path: string): Promise<Response> {
  const response = await fetch(`api/v1/${path}`);
  if (!response.ok) throw new Error(httpStatus(response.url, response.status));
  return response;
}
