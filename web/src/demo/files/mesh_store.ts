// Store of the user's meshes in IndexedDB. Without IndexedDB, as in some private windows, meshes are lost
// with the page.

import type { ImportOptions } from "../worker/messages";

// Maximum number of meshes per upload, and in the store.
export const MAX_FILES = 50;

const DATABASE = "ngf-grasp";
const MESHES = "meshes";

// File with its import options and the time when it was added (ms).
interface StoredMesh {
  file: File;
  options?: ImportOptions;
  addedAt: number;
}

export class MeshStore {
  readonly #database: Promise<IDBDatabase | null> = open();

  // Stored meshes, oldest first.
  async files(): Promise<StoredMesh[]> {
    const database = await this.#database;
    if (!database) return [];
    const stored = await result<StoredMesh[]>(database.transaction(MESHES).objectStore(MESHES).getAll()).catch(() => []);
    return stored.sort((a, b) => a.addedAt - b.addedAt);
  }

  // Stores a file, replacing an earlier one of the same name; changed options keep its time. The oldest files
  // beyond the limit are deleted. Returns whether the file is stored.
  async put(file: File, options?: ImportOptions): Promise<boolean> {
    const isStored = await this.#update(async (meshes) => {
      const previous = options && (await result<StoredMesh | undefined>(meshes.get(file.name)));
      const addedAt = previous?.addedAt ?? Date.now();
      await result(meshes.put({ file, addedAt, ...(options && { options }) } satisfies StoredMesh, file.name));
    });
    const stored = await this.files();
    for (const { file } of stored.slice(0, Math.max(0, stored.length - MAX_FILES))) await this.delete(file.name);
    return isStored;
  }

  async delete(fileName: string): Promise<void> {
    await this.#update((meshes) => result(meshes.delete(fileName)));
  }

  // Returns whether the transaction succeeded; it fails if the browser's quota is exceeded.
  async #update(act: (meshes: IDBObjectStore) => Promise<unknown>): Promise<boolean> {
    const database = await this.#database;
    if (!database) return false;
    try {
      const transaction = database.transaction(MESHES, "readwrite");
      await Promise.all([act(transaction.objectStore(MESHES)), committed(transaction)]);
      return true;
    } catch (error) {
      console.info("not stored:", error);
      return false;
    }
  }
}

async function open(): Promise<IDBDatabase | null> {
  try {
    const request = indexedDB.open(DATABASE, 1);
    request.onupgradeneeded = () => request.result.createObjectStore(MESHES);
    return await result(request);
  } catch {
    return null;
  }
}

function result<T>(request: IDBRequest<T>): Promise<T> {
  return new Promise((resolve, reject) => {
    request.onsuccess = () => resolve(request.result);
    request.onerror = () => reject(request.error);
  });
}

// A successful request can still be rolled back, so the transaction itself is awaited.
function committed(transaction: IDBTransaction): Promise<void> {
  return new Promise((resolve, reject) => {
    transaction.oncomplete = () => resolve();
    transaction.onabort = () => reject(transaction.error);
  });
}
