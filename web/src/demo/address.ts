// What the address of the page asks for: ?model=ID, with &training=JOB where that goes on, and ?mesh=ID or
// ?episode=DATASET/INDEX, or a link's.

import { answered } from "../common/strings";
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
  fetchFile(): Promise<File | null>;
}

export function askedFor(shared: Shared | null, search = location.search): Asked {
  const query = new URLSearchParams(search);
  const [mesh, episode] = [query.get("mesh") ?? shared?.mesh ?? null, query.get("episode")];
  return {
    model: shared?.model ?? query.get("model") ?? "default",
    training: (!shared && query.get("training")) || null,
    brings: mesh !== null || episode !== null,
    plays: mesh === null && episode !== null,
    fetchFile: async () => {
      if (mesh !== null) return fetchMesh(`meshes/${encodeURIComponent(mesh)}`);
      if (episode === null) return null;
      const [dataset = "", index = ""] = episode.split("/").map(encodeURIComponent);
      const answer = await get(`datasets/${dataset}/episodes/${index}`);
      return new File([await answer.blob()], `${dataset}-${index}.json`);
    },
  };
}

async function fetchMesh(path: string): Promise<File> {
  const { name } = (await (await get(path)).json()) as { name: string };
  return new File([await (await get(`${path}/file`)).blob()], name);
}

async function get(path: string): Promise<Response> {
  const answer = await fetch(`api/v1/${path}`);
  if (!answer.ok) throw new Error(answered(answer.url, answer.status));
  return answer;
}
