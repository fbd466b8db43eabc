// Files that the user drops, pastes or selects: single files, folders, ZIP archives.

import { MESH_EXTENSIONS } from "../../common/constants";
import { FILES } from "../app/strings";
import { embedBuffers } from "./gltf_buffers";
import { MAX_FILES } from "./mesh_store";
import type { ArchiveFile } from "./zip";

// Extensions that the worker reads: meshes, archives of meshes, recordings.
const READABLE = new RegExp(`\\.(${[...MESH_EXTENSIONS, "json", "zip", "gz"].join("|")})$`, "i");
const ARCHIVE = /\.zip$/i;
const GLTF = /\.gltf$/i;
// Buffers of glTF files.
const BUFFER = /\.(bin|buffer|buf|data|dat)$/i;
// Hidden files, such as the `._NAME` that macOS writes for each file.
const HIDDEN = /^\./;

// Whether a file is a recorded attempt or a demonstration, which refers to its own object.
export function isRecording(fileName: string): boolean {
  return /\.json$/i.test(fileName);
}

// Path of each dropped file in its folder.
const dropPaths = new WeakMap<File, string>();

// All files of a drop, including those in folders.
export async function droppedFiles(transfer: DataTransfer | null): Promise<File[]> {
  const entries = [...(transfer?.items ?? [])].map((item) => item.webkitGetAsEntry());
  const files: File[] = [];
  for (const entry of entries) if (entry) await collect(entry, files);
  return files;
}

async function collect(entry: FileSystemEntry, files: File[]): Promise<void> {
  // One extra file shows that the limit is exceeded; another one may be an unreadable first file.
  if (files.filter(({ name }) => READABLE.test(name)).length > MAX_FILES + 1) return;
  if (entry.isFile) {
    if (!isNeeded(entry.name) && files.length > 0) return;
    const file = await new Promise<File>((resolve, reject) => (entry as FileSystemFileEntry).file(resolve, reject));
    dropPaths.set(file, entry.fullPath.replace(/^\//, ""));
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

function isNeeded(name: string): boolean {
  return !HIDDEN.test(name) && (READABLE.test(name) || BUFFER.test(name));
}

// The readable files, with archives unpacked and glTF buffers embedded. Without any, the first file is returned, so
// that the worker reports why it cannot be read.
export async function readableFiles(files: Iterable<File>): Promise<File[]> {
  const all = [...files];
  const needed = all.filter(({ name }) => isNeeded(name));
  const unpacked = await Promise.all(needed.map(async (file) => (ARCHIVE.test(file.name) ? unpack(file) : [{ path: pathOf(file), file }])));
  const found = unpacked.flat();
  const readable = found.filter(({ file }) => READABLE.test(file.name));
  if (readable.length === 0) return all.slice(0, 1);
  return withUniqueNames(await Promise.all(readable.map((own) => (GLTF.test(own.file.name) ? embedBuffers(own.file, finder(own, found)) : own.file))));
}

function pathOf(file: File): string {
  return dropPaths.get(file) ?? (file.webkitRelativePath || file.name);
}

// Finds a file by its path relative to another one. Files that are selected one by one have no folder; then the name
// suffices. Names have no case, as in Windows.
function finder({ path }: ArchiveFile, found: ArchiveFile[]): (relative: string) => File | undefined {
  const folder = path.slice(0, path.lastIndexOf("/") + 1);
  return (relative) => {
    const wanted = `${folder}${relative}`.toLowerCase();
    const exact = found.find((other) => other.path.toLowerCase() === wanted);
    const name = wanted.split("/").pop();
    const named = found.filter(({ file }) => file.name.toLowerCase() === name);
    return (exact ?? (named.length === 1 ? named[0] : undefined))?.file;
  };
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

async function unpack(archive: File): Promise<ArchiveFile[]> {
  const files = await unzip(archive).catch((error: unknown) => {
    const why = error instanceof Error ? error.message : String(error);
    throw new Error(FILES.cannotOpen(archive.name, why));
  });
  if (!files.some(({ file }) => READABLE.test(file.name))) throw new Error(FILES.noMesh(archive.name));
  return files;
}

// The code for archives is downloaded when the first one is opened.
async function unzip(archive: File): Promise<ArchiveFile[]> {
  const zip = await import("./zip").catch(() => {
    throw new Error(FILES.noArchiveCode);
  });
  return zip.unzip(archive, (name) => isNeeded(name) && !ARCHIVE.test(name));
}
