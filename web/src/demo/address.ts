// What the address of the page asks for: ?model=ID, with &training=JOB where that goes on, and ?mesh=ID or
// ?episode=DATASET/INDEX, or a link's.

import { answered } from "../common/strings";
import type { Progress } from "./protocol";
import type { Shared } from "./share";

export interface Asked {
  model: string;
  // The job that trains the model, if what it learns is to act, too.
  training: string | null;
  // Whether it asks for one of these.
  brings: boolean;
  // Whether that is a demonstration, which plays by itself.
  plays: boolean;
  // The mesh or the demonstration, if there is one.
  fetchFile(tell: (progress: Progress) => void): Promise<File | null>;
}

export function askedFor(shared: Shared | null, search = location.search): Asked {
  const query = new URLSearchParams(search);
  const [mesh, episode] = [query.get("mesh") ?? shared?.mesh ?? null, query.get("episode")];
  return {
    model: shared?.model ?? query.get("model") ?? "default",
    training: (!shared && query.get("training")) || null,
    brings: mesh !== null || episode !== null,
    plays: mesh === null && episode !== null,
    fetchFile: async (tell) => {
      if (mesh !== null) return fetchMesh(`meshes/${encodeURIComponent(mesh)}`, tell);
      if (episode === null) return null;
      const [dataset = "", index = ""] = episode.split("/").map(encodeURIComponent);
      const name = `${dataset}-${index}.json`;
      return body(await get(`datasets/${dataset}/episodes/${index}`), name, tell);
    },
  };
}

async function fetchMesh(path: string, tell: (progress: Progress) => void): Promise<File> {
  const { name } = (await (await get(path)).json()) as { name: string };
  return body(await get(`${path}/file`), name, tell);
}

// The whole of an answer as a file, and how much of it is there.
async function body(answer: Response, name: string, tell: (progress: Progress) => void): Promise<File> {
  const parts: Uint8Array<ArrayBuffer>[] = [];
  // What is compressed on its way has another length than the file.
  const length = answer.headers.has("Content-Encoding") ? null : answer.headers.get("Content-Length");
  const total = length === null ? null : Number(length);
  const told = { kind: "progress", label: name, total, unit: "bytes" } as const;
  let done = 0;
  try {
    for (const reader = answer.body!.getReader(); ; ) {
      const part = await reader.read();
      if (part.done) return new File(parts, name);
      parts.push(part.value);
      done += part.value.length;
      tell({ ...told, done, finished: false });
    }
  } finally {
    tell({ ...told, done, finished: true });
  }
}

async function get(path: string): Promise<Response> {
  const answer = await fetch(`api/v1/${path}`);
  if (!answer.ok) throw new Error(answered(answer.url, answer.status));
  return answer;
}
