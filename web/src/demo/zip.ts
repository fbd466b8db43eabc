// The files in a ZIP archive, unpacked by the browser itself (APPNOTE 6.3, sections 4.3.7, 4.3.12, 4.3.16).

import { FILES } from "./strings";

const END = 0x06054b50;
const ENTRY = 0x02014b50;
// The end stands behind at most this long a comment.
const LONGEST_END = 22 + 0xffff;
const STORED = 0;
const DEFLATED = 8;
// Files that are taken at once: more, nobody wants to look through.
export const MOST = 50;
// Size of each (bytes): the worker refuses longer ones.
const LONGEST = 51 * 1024 * 1024;

// Those that are wanted by their names, one more than are taken at most. Throws where the archive is damaged or too large.
export async function unzip(archive: File, isWanted: (name: string) => boolean): Promise<File[]> {
  const bytes = new DataView(await archive.arrayBuffer());
  const files: File[] = [];
  for (const { name, method, size, start } of entries(bytes)) {
    const last = name.split("/").pop() ?? name;
    if (!isWanted(last) || name.includes("__MACOSX") || files.length > MOST) continue;
    // Behind its own header, whose name and extra fields may be longer than in the list.
    const from = start + 30 + bytes.getUint16(start + 26, true) + bytes.getUint16(start + 28, true);
    const packed = new Uint8Array(bytes.buffer, from, size);
    files.push(new File([await unpacked(packed, method, name)], last));
  }
  return files;
}

function* entries(bytes: DataView): Generator<{ name: string; method: number; size: number; start: number }> {
  let end = bytes.byteLength - 22;
  const first = Math.max(0, bytes.byteLength - LONGEST_END);
  while (end >= first && bytes.getUint32(end, true) !== END) end--;
  if (end < first) throw new Error(FILES.noEnd);
  const count = bytes.getUint16(end + 10, true);
  let at = bytes.getUint32(end + 16, true);
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
async function unpacked(packed: Uint8Array<ArrayBuffer>, method: number, name: string): Promise<Blob> {
  if (method === STORED) return new Blob([packed]);
  if (method !== DEFLATED) throw new Error(FILES.unknownPacking(name));
  const reader = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate-raw")).getReader();
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
