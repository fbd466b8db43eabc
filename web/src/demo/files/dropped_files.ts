// Files that the user drops, pastes or selects: single files, folders, ZIP archives.

import { MESH_EXTENSIONS } from "../../common/constants";
import { FILES } from "../app/strings";
import { MAX_FILES, unzip } from "./zip";

// Extensions that the worker reads: meshes, archives of meshes, recordings.
const READABLE = new RegExp(`\\.(${[...MESH_EXTENSIONS, "json", "zip"].join("|")})$`, "i");
const ARCHIVE = /\.zip$/i;

// Whether a file is a recorded attempt or a demonstration, which refers to its own object.
export function isRecording(fileName: string): boolean {
  return /\.json$/i.test(fileName);
}

// All files of a drop, including those in folders.
export async function droppedFiles(transfer: DataTransfer | null): Promise<File[]> {
  const entries = [...(transfer?.items ?? [])].map((item) => item.webkitGetAsEntry());
  const files: File[] = [];
  for (const entry of entries) if (entry) await collect(entry, files);
  return files;
}

async function collect(entry: FileSystemEntry, files: File[]): Promise<void> {
  // One extra file shows that the limit is exceeded; another one may be an unreadable first file.
  if (files.length > MAX_FILES + 1) return;
  if (entry.isFile) {
    if (!READABLE.test(entry.name) && files.length > 0) return;
    const file = await new Promise<File>((resolve, reject) => (entry as FileSystemFileEntry).file(resolve, reject));
    files.push(file);
    return;
  }
  const reader = (entry as FileSystemDirectoryEntry).createReader();
  // `readEntries` returns a folder in chunks and ends with an empty one.
  for (;;) {
    const chunk = await new Promise<FileSystemEntry[]>((resolve, reject) => reader.readEntries(resolve, reject));
    if (chunk.length === 0) return;
    for (const child of chunk) await collect(child, files);
  }
}

// The readable files, with archives unpacked. Without any, the first file is returned, so that the worker
// reports why it cannot be read.
export async function readableFiles(files: Iterable<File>): Promise<File[]> {
  const all = [...files];
  const readable = all.filter(({ name }) => READABLE.test(name));
  const unpacked = await Promise.all(readable.map(async (file) => (ARCHIVE.test(file.name) ? unpack(file) : [file])));
  return readable.length > 0 ? withUniqueNames(unpacked.flat()) : all.slice(0, 1);
}

// Files from several folders can share a name: later ones get a number.
function withUniqueNames(files: File[]): File[] {
  const names = new Set<string>();
  return files.map((file) => {
    let name = file.name;
    for (let k = 2; names.has(name); k++) name = file.name.replace(/(\.\w+)?$/, ` (${k})$1`);
    names.add(name);
    return name === file.name ? file : new File([file], name);
  });
}

async function unpack(archive: File): Promise<File[]> {
  const files = await unzip(archive, (name) => READABLE.test(name) && !ARCHIVE.test(name)).catch((error: unknown) => {
    // An offset in the archive points beyond its end.
    const why = error instanceof RangeError ? FILES.truncated : error instanceof Error ? error.message : String(error);
    throw new Error(FILES.cannotOpen(archive.name, why));
  });
  if (files.length === 0) throw new Error(FILES.noMesh(archive.name));
  return files;
}
