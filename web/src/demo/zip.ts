// The files in a ZIP archive, unpacked by the browser itself (APPNOTE 6.3, sections 4.3.7, 4.3.12, 4.3.16).

import { FILES } from "./strings";

const END = 0x06054b50;
const ENTRY = 0x02014b50;
// The end stands behind at most this long a comment.
const LONGEST_END = 22 + 0xffff;
// Before a name and what else belongs to an entry.
const HEADER = 30;
const STORED = 0;
const DEFLATED = 8;
// Files that are taken at once: more, nobody wants to look through.
export const MOST = 50;
// Size of each (bytes): the worker refuses longer ones.
const LONGEST = 250e6;
// Size of all that are taken (bytes).
const MOST_BYTES = 500e6;

// Those that are wanted by their names, one more than are taken at most; of the archive no more is read than they need.
// Throws where it is damaged or they are too large.
export async function unzip(archive: File, isWanted: (name: string) => boolean): Promise<File[]> {
  const files: File[] = [];
  let bytes = 0;
  for (const { name, method, size, start } of entries(await list(archive))) {
    const last = name.split("/").pop() ?? name;
    if (!isWanted(last) || name.includes("__MACOSX") || files.length > MOST) continue;
    // Behind its own header, whose name and extra fields may be longer than in the list.
    const header = await part(archive, start, HEADER);
    const from = start + HEADER + header.getUint16(26, true) + header.getUint16(28, true);
    if (from + size > archive.size) throw new Error(FILES.cutOff);
    const file = await unpacked(archive.slice(from, from + size), method, name);
    bytes += file.size;
    if (bytes > MOST_BYTES) throw new Error(FILES.tooMuch);
    files.push(new File([file], last));
  }
  return files;
}

async function part(archive: File, from: number, length: number): Promise<DataView> {
  return new DataView(await archive.slice(from, from + length).arrayBuffer());
}

interface List {
  bytes: DataView;
  count: number;
}

async function list(archive: File): Promise<List> {
  const tail = await part(archive, Math.max(0, archive.size - LONGEST_END), LONGEST_END);
  let end = tail.byteLength - 22;
  while (end >= 0 && tail.getUint32(end, true) !== END) end--;
  if (end < 0) throw new Error(FILES.noEnd);
  const [length, from] = [tail.getUint32(end + 12, true), tail.getUint32(end + 16, true)];
  if (length > LONGEST) throw new Error(FILES.damagedList);
  return { bytes: await part(archive, from, length), count: tail.getUint16(end + 10, true) };
}

function* entries({ bytes, count }: List): Generator<{ name: string; method: number; size: number; start: number }> {
  let at = 0;
  for (let i = 0; i < count; i++) {
    if (bytes.getUint32(at, true) !== ENTRY) throw new Error(FILES.damagedList);
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

// What an entry says of its length is not believed.
async function unpacked(packed: Blob, method: number, name: string): Promise<Blob> {
  if (packed.size > LONGEST) throw new Error(FILES.tooLong(name));
  if (method === STORED) return packed;
  if (method !== DEFLATED) throw new Error(FILES.unknownPacking(name));
  const reader = packed.stream().pipeThrough(new DecompressionStream("deflate-raw")).getReader();
  const parts: Uint8Array<ArrayBuffer>[] = [];
  let length = 0;
  for (;;) {
    const { done, value } = await reader.read();
    if (done) return new Blob(parts);
    length += value.length;
    if (length > LONGEST) {
      await reader.cancel();
      throw new Error(FILES.tooLong(name));
    }
    parts.push(value);
  }
}
