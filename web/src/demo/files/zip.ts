// ZIP archives; the library reads their directory, and the browser decompresses the entries.

import { BlobReader, BlobWriter, ERR_ENCRYPTED, ERR_UNSUPPORTED_COMPRESSION, ZipReader, configure } from "@zip.js/zip.js/lib/zip-core-native.js";
import type { FileEntry } from "@zip.js/zip.js/lib/zip-core-native.js";
import { FILES } from "../app/strings";

// Maximum number of unpacked entries, including those that are no mesh.
const MAX_ENTRIES = 1000;
// Maximum size of one file (bytes); the worker rejects larger ones.
const MAX_FILE_BYTES = 250e6;
// Maximum total size (bytes).
const MAX_TOTAL_BYTES = 500e6;

// The entries are decompressed on this thread: a worker of the library would be a second script.
configure({ useWebWorkers: false });

// File of an archive, with its path there.
export interface ArchiveFile {
  path: string;
  file: File;
}

// Unpacks the files whose names are wanted. Throws if the archive is corrupt or encrypted, or if the files are too
// large.
export async function unzip(archive: File, isWanted: (name: string) => boolean): Promise<ArchiveFile[]> {
  const reader = new ZipReader(new BlobReader(archive));
  try {
    const files: ArchiveFile[] = [];
    let bytes = 0;
    for await (const entry of reader.getEntriesGenerator()) {
      const path = entry.filename.replaceAll("\\", "/");
      const name = path.split("/").pop() ?? path;
      if (entry.directory || path.includes("__MACOSX") || !isWanted(name)) continue;
      if (files.length >= MAX_ENTRIES) break;
      const blob = await decompress(entry, path);
      bytes += blob.size;
      if (bytes > MAX_TOTAL_BYTES) throw new Error(FILES.totalTooLarge);
      files.push({ path, file: new File([blob], name) });
    }
    return files;
  } finally {
    await reader.close();
  }
}

async function decompress(entry: FileEntry, path: string): Promise<Blob> {
  if (entry.encrypted) throw new Error(FILES.encrypted);
  const tooLarge = () => new Error(FILES.entryTooLarge(path));
  if (entry.uncompressedSize > MAX_FILE_BYTES) throw tooLarge();
  const stop = new AbortController();
  // The size in the directory is not trusted; the decompressed bytes are counted.
  const onprogress = (done: number): undefined => {
    if (done > MAX_FILE_BYTES) stop.abort(tooLarge());
  };
  const data = await entry.getData(new BlobWriter(), { signal: stop.signal, onprogress }).catch((error: unknown) => {
    const message = error instanceof Error ? error.message : String(error);
    if (message === ERR_ENCRYPTED) throw new Error(FILES.encrypted);
    if (message === ERR_UNSUPPORTED_COMPRESSION) throw new Error(FILES.unknownCompression(path));
    throw error;
  });
  if (data.size > MAX_FILE_BYTES) throw tooLarge();
  return data;
}
