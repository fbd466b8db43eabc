// ZIP reader (APPNOTE 6.3, sections 4.3.7, 4.3.12, 4.3.16); the browser decompresses the entries.

import { FILES } from "../app/strings";

// Signatures of the end record and of a directory entry.
const END = 0x06054b50;
const ENTRY = 0x02014b50;
// End record (22 bytes) with the longest comment.
const MAX_END_BYTES = 22 + 0xffff;
// Fixed part of a local file header (bytes).
const HEADER = 30;
const STORED = 0;
const DEFLATED = 8;
// Maximum number of files per upload, and in the mesh store.
export const MAX_FILES = 50;
// Maximum size of one file (bytes); the worker rejects larger ones.
const MAX_FILE_BYTES = 250e6;
// Maximum total size (bytes).
const MAX_TOTAL_BYTES = 500e6;

// Unpacks the files whose names are wanted, up to MAX_FILES + 1, reading only their part of the archive.
// Throws if the archive is corrupt or the files are too large.
export async function unzip(archive: File, isWanted: (name: string) => boolean): Promise<File[]> {
  const files: File[] = [];
  let bytes = 0;
  for (const { name, method, size, start } of entries(await readDirectory(archive))) {
    const last = name.split("/").pop() ?? name;
    if (!isWanted(last) || name.includes("__MACOSX") || files.length > MAX_FILES) continue;
    // Name and extra fields of the local header can be longer than those of the directory entry.
    const header = await view(archive, start, HEADER);
    const from = start + HEADER + header.getUint16(26, true) + header.getUint16(28, true);
    if (from + size > archive.size) throw new Error(FILES.truncated);
    const file = await decompress(archive.slice(from, from + size), method, name);
    bytes += file.size;
    if (bytes > MAX_TOTAL_BYTES) throw new Error(FILES.totalTooLarge);
    files.push(new File([file], last));
  }
  return files;
}

async function view(archive: File, from: number, length: number): Promise<DataView> {
  return new DataView(await archive.slice(from, from + length).arrayBuffer());
}

interface Directory {
  bytes: DataView;
  count: number;
}

async function readDirectory(archive: File): Promise<Directory> {
  const tail = await view(archive, Math.max(0, archive.size - MAX_END_BYTES), MAX_END_BYTES);
  let end = tail.byteLength - 22;
  while (end >= 0 && tail.getUint32(end, true) !== END) end--;
  if (end < 0) throw new Error(FILES.noEndRecord);
  const [length, from] = [tail.getUint32(end + 12, true), tail.getUint32(end + 16, true)];
  if (length > MAX_FILE_BYTES) throw new Error(FILES.corruptDirectory);
  return { bytes: await view(archive, from, length), count: tail.getUint16(end + 10, true) };
}

function* entries({ bytes, count }: Directory): Generator<{ name: string; method: number; size: number; start: number }> {
  let at = 0;
  for (let i = 0; i < count; i++) {
    if (bytes.getUint32(at, true) !== ENTRY) throw new Error(FILES.corruptDirectory);
    const lengths = [28, 30, 32].map((field) => bytes.getUint16(at + field, true)) as [number, number, number];
    yield {
      name: new TextDecoder().decode(new Uint8Array(bytes.buffer, at + 46, lengths[0])),
      method: bytes.getUint16(at + 10, true),
      size: bytes.getUint32(at + 20, true),
      start: bytes.getUint32(at + 42, true),
    };
    at += 46 + lengths[0] + lengths[1] + lengths[2];
  }
}

// The size in the directory is not trusted; the decompressed bytes are counted.
async function decompress(packed: Blob, method: number, name: string): Promise<Blob> {
  if (packed.size > MAX_FILE_BYTES) throw new Error(FILES.entryTooLarge(name));
  if (method === STORED) return packed;
  if (method !== DEFLATED) throw new Error(FILES.unknownCompression(name));
  const reader = packed.stream().pipeThrough(new DecompressionStream("deflate-raw")).getReader();
  const chunks: Uint8Array<ArrayBuffer>[] = [];
  let length = 0;
  for (;;) {
    const { done, value } = await reader.read();
    if (done) return new Blob(chunks);
    length += value.length;
    if (length > MAX_FILE_BYTES) {
      await reader.cancel();
      throw new Error(FILES.entryTooLarge(name));
    }
    chunks.push(value);
  }
}
