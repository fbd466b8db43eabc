// Meshes that were brought, kept in the browser's own store until somebody removes them. Where there is no store, as in
// some private windows, they are there until the page is left.

import type { Told } from "./protocol";
import { MOST } from "./zip";

const DATABASE = "ngf-grasp";
const MESHES = "meshes";

// A file, what was said of it, and when it was brought (ms).
interface Kept {
  file: File;
  told?: Told;
  at: number;
}

export class Shelf {
  readonly #database: Promise<IDBDatabase | null> = open();

  // Those that are kept, the first one brought first.
  async files(): Promise<Kept[]> {
    return this.#kept();
  }

  // The last of a name counts; of too many, the first ones brought make room. What is said of a file later does not make
  // it a newer one.
  async keep(file: File, told?: Told): Promise<void> {
    const before = told && (await this.#kept()).find((kept) => kept.file.name === file.name);
    const at = before?.at ?? Date.now();
    await this.#change((meshes) => meshes.put({ file, at, ...(told && { told }) } satisfies Kept, file.name));
    const kept = await this.#kept();
    for (const { file } of kept.slice(0, Math.max(0, kept.length - MOST))) await this.forget(file.name);
  }

  async forget(fileName: string): Promise<void> {
    await this.#change((meshes) => meshes.delete(fileName));
  }

  async #kept(): Promise<Kept[]> {
    const database = await this.#database;
    if (!database) return [];
    const kept = await answer<Kept[]>(database.transaction(MESHES).objectStore(MESHES).getAll()).catch(() => []);
    return kept.sort((a, b) => a.at - b.at);
  }

  // What a full store does not take is there until the page is left.
  async #change(act: (meshes: IDBObjectStore) => IDBRequest): Promise<void> {
    const database = await this.#database;
    if (!database) return;
    try {
      await answer(act(database.transaction(MESHES, "readwrite").objectStore(MESHES)));
    } catch (error) {
      console.info("not kept:", error);
    }
  }
}

async function open(): Promise<IDBDatabase | null> {
  try {
    const request = indexedDB.open(DATABASE, 1);
    request.onupgradeneeded = () => request.result.createObjectStore(MESHES);
    return await answer(request);
  } catch {
    return null;
  }
}

function answer<T>(request: IDBRequest<T>): Promise<T> {
  return new Promise((resolve, reject) => {
    request.onsuccess = () => resolve(request.result);
    request.onerror = () => reject(request.error);
  });
}
