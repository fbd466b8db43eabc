// glTF with its buffers in other files of the same upload: both become one GLB, which is stored and shared as
// one file.

// Finds a file of the upload by its path relative to the glTF file.
export type FindFile = (path: string) => File | undefined;

interface BufferView {
  buffer: number;
  byteOffset?: number;
}

interface Gltf {
  buffers?: { uri?: string; byteLength: number }[];
  bufferViews?: BufferView[];
}

// Magic number and version of GLB, and types of its chunks.
const GLB = 0x46546c67;
const VERSION = 2;
const JSON_CHUNK = 0x4e4f534a;
const BINARY_CHUNK = 0x004e4942;

// The file with those of its buffers that are in other files. The other buffers stay as they are: the worker reads
// embedded ones, and names a missing one if the geometry needs it.
export async function embedBuffers(file: File, find: FindFile): Promise<File> {
  const gltf = await parse(file);
  const buffers = gltf?.buffers ?? [];
  if (!gltf || buffers.length === 0) return file;
  const files = buffers.map(({ uri }) => (uri === undefined || uri.startsWith("data:") ? undefined : findEscaped(uri, find)));
  if (files.every((buffer) => buffer === undefined)) return file;
  const contents: ArrayBuffer[] = [];
  // Offset of each found buffer in the binary chunk, which is the first buffer, and new index of the others.
  const offsets = new Map<number, number>();
  const indices = new Map<number, number>();
  const kept: typeof buffers = [];
  let length = 0;
  for (const [index, found] of files.entries()) {
    if (found) {
      const content = await found.arrayBuffer();
      offsets.set(index, length);
      length += padded(content.byteLength);
      contents.push(content);
    } else {
      indices.set(index, kept.push(buffers[index]!));
    }
  }
  for (const view of gltf.bufferViews ?? []) {
    view.byteOffset = (view.byteOffset ?? 0) + (offsets.get(view.buffer) ?? 0);
    view.buffer = indices.get(view.buffer) ?? 0;
  }
  const json = new TextEncoder().encode(JSON.stringify({ ...gltf, buffers: [{ byteLength: length }, ...kept] }));
  return new File(glb(json, contents, length), file.name);
}

async function parse(file: File): Promise<Gltf | null> {
  try {
    // Drops a byte order mark.
    return JSON.parse(await file.text()) as Gltf;
  } catch {
    // GLB, or invalid JSON.
    return null;
  }
}

function findEscaped(uri: string, find: FindFile): File | undefined {
  const normalized = (path: string) => path.replaceAll("\\", "/").replace(/^\.\//, "");
  let decoded = uri;
  try {
    decoded = decodeURIComponent(uri);
  } catch {
    // The name contains a percent sign that is not escaped.
  }
  return find(normalized(decoded)) ?? find(normalized(uri));
}

function padded(length: number): number {
  return Math.ceil(length / 4) * 4;
}

function glb(json: Uint8Array<ArrayBuffer>, contents: ArrayBuffer[], length: number): BlobPart[] {
  const jsonLength = padded(json.length);
  const words = (...values: number[]) => {
    const view = new DataView(new ArrayBuffer(4 * values.length));
    values.forEach((value, i) => view.setUint32(4 * i, value, true));
    return view.buffer;
  };
  const padding = (size: number, byte: number) => new Uint8Array(padded(size) - size).fill(byte);
  return [
    words(GLB, VERSION, 12 + 8 + jsonLength + 8 + length, jsonLength, JSON_CHUNK),
    json,
    padding(json.length, 0x20),
    words(length, BINARY_CHUNK),
    ...contents.flatMap((content) => [content, padding(content.byteLength, 0)]),
  ];
}
