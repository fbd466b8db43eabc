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
    const database = await this.#database;
    if (!database) return [];
    const kept = await answer<Kept[]>(database.transaction(MESHES).objectStore(MESHES).getAll()).catch(() => []);
    return kept.sort((a, b) => a.at - b.at);
  }

  // The last of a name counts; of too many, the first ones brought make room. What is said of a file later does not make
  // it a newer one. Gives whether it is kept.
  async keep(file: File, told?: Told): Promise<boolean> {
    const isKept = await this.#change(async (meshes) => {
      const before = told && (await answer<Kept | undefined>(meshes.get(file.name)));
      const at = before?.at ?? Date.now();
      await answer(meshes.put({ file, at, ...(told && { told }) } satisfies Kept, file.name));
    });
    const kept = await this.files();
    for (const { file } of kept.slice(0, Math.max(0, kept.length - MOST))) await this.forget(file.name);
    return isKept;
  }

  async forget(fileName: string): Promise<void> {
    await this.#change((meshes) => answer(meshes.delete(fileName)));
  }

  // Gives whether the store has it: what a full one does not take is there until the page is left.
  async #change(act: (meshes: IDBObjectStore) => Promise<unknown>): Promise<boolean> {
    const database = await this.#database;
    if (!database) return false;
    try {
      const transaction = database.transaction(MESHES, "readwrite");
      await Promise.all([act(transaction.objectStore(MESHES)), completed(transaction)]);
      return true;
    } catch (error) {
      console.info("not kept:", error);
      return false;
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

// What was asked for may succeed and yet not be written.
function completed(transaction: IDBTransaction): Promise<void> {
  return new Promise((resolve, reject) => {
    transaction.oncomplete = () => resolve();
    transaction.onabort = () => reject(transaction.error);
  });
}
