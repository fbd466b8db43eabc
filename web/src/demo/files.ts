// Files as people bring them: one or several, a folder, from the clipboard.

import { FILES } from "./strings";
import { MOST, unzip } from "./zip";

// What the worker reads: meshes, archives of them, what plays.
const READABLE = /\.(obj|stl|ply|off|glb|gltf|json|zip)$/i;
const ARCHIVE = /\.zip$/i;

// Whether it is an episode or a demonstration, which brings its own object.
export function plays(fileName: string): boolean {
  return /\.json$/i.test(fileName);
}

// All files of a drop, those in folders too.
export async function dropped(transfer: DataTransfer | null): Promise<File[]> {
  const entries = [...(transfer?.items ?? [])].map((item) => item.webkitGetAsEntry());
  const files: File[] = [];
  for (const entry of entries) if (entry) await collect(entry, files);
  return files;
}

async function collect(entry: FileSystemEntry, files: File[]): Promise<void> {
  // One more than are taken tells that there are more, and the first may be one that cannot be read.
  if (files.length > MOST + 1) return;
  if (entry.isFile) {
    if (!READABLE.test(entry.name) && files.length > 0) return;
    const file = await new Promise<File>((resolve, reject) => (entry as FileSystemFileEntry).file(resolve, reject));
    files.push(file);
    return;
  }
  const reader = (entry as FileSystemDirectoryEntry).createReader();
  // A folder is read in parts, until one is empty.
  for (;;) {
    const part = await new Promise<FileSystemEntry[]>((resolve, reject) => reader.readEntries(resolve, reject));
    if (part.length === 0) return;
    for (const inner of part) await collect(inner, files);
  }
}

// Those that can be read, out of archives too; if there is none, the first, so that somebody hears why not.
export async function readable(files: Iterable<File>): Promise<File[]> {
  const all = [...files];
  const known = all.filter(({ name }) => READABLE.test(name));
  const found = await Promise.all(known.map(async (file) => (ARCHIVE.test(file.name) ? opened(file) : [file])));
  return known.length > 0 ? distinct(found.flat()) : all.slice(0, 1);
}

// What comes from several folders may have one name: the second of it gets a number.
function distinct(files: File[]): File[] {
  const names = new Set<string>();
  return files.map((file) => {
    let name = file.name;
    for (let k = 2; names.has(name); k++) name = file.name.replace(/(\.\w+)?$/, ` (${k})$1`);
    names.add(name);
    return name === file.name ? file : new File([file], name);
  });
}

async function opened(archive: File): Promise<File[]> {
  const files = await unzip(archive, (name) => READABLE.test(name) && !ARCHIVE.test(name)).catch((error: unknown) => {
    // What it says of its parts points beyond its end.
    const why = error instanceof RangeError ? FILES.cutOff : error instanceof Error ? error.message : String(error);
    throw new Error(FILES.cannotOpen(archive.name, why));
  });
  if (files.length === 0) throw new Error(FILES.noMesh(archive.name));
  return files;
}
