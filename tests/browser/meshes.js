// Test meshes in all supported formats.

// Box of 40 x 60 x 120 in OBJ, a format without unit.
export const BOX = `v 0 0 0\nv 40 0 0\nv 40 60 0\nv 0 60 0\nv 0 0 120\nv 40 0 120\nv 40 60 120\nv 0 60 120
f 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n`;

// The same box in meters as glTF with an embedded buffer; two of its faces are missing.
export function gltf() {
  const corners = [0, 1].flatMap((z) => [[0, 0], [1, 0], [1, 1], [0, 1]].map(([x, y]) => [0.04 * x, 0.12 * z, -0.06 * y]));
  const faces = [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5]].flatMap(([a, b, c, d]) => [a, b, c, a, c, d]);
  const buffer = Buffer.concat([Buffer.from(new Float32Array(corners.flat()).buffer), Buffer.from(new Uint16Array(faces).buffer)]);
  const uri = `data:application/octet-stream;base64,${buffer.toString("base64")}`;
  return JSON.stringify({
    asset: { version: "2.0" },
    scenes: [{ nodes: [0] }],
    nodes: [{ mesh: 0 }],
    meshes: [{ primitives: [{ attributes: { POSITION: 0 }, indices: 1 }] }],
    buffers: [{ byteLength: buffer.length, uri }],
    bufferViews: [{ buffer: 0, byteLength: 96 }, { buffer: 0, byteOffset: 96, byteLength: 2 * faces.length }],
    accessors: [
      { bufferView: 0, componentType: 5126, count: 8, type: "VEC3" },
      { bufferView: 1, componentType: 5123, count: faces.length, type: "SCALAR" },
    ],
  });
}

// The same box in the other formats.
export function otherFormats() {
  const lines = BOX.trim().split("\n").map((line) => line.split(" "));
  const corners = lines.filter(([kind]) => kind === "v").map(([, ...xyz]) => xyz);
  const faces = lines.filter(([kind]) => kind === "f").map(([, ...indices]) => indices.map((index) => index - 1));
  const rows = (all, prefix = []) => all.map((row) => [...prefix, ...row].join(" ")).join("\n");
  const triangles = faces.flatMap(([a, b, c, d]) => [[a, b, c], [a, c, d]]);
  const facet = (triangle) => `facet normal 0 0 0\nouter loop\n${rows(triangle.map((i) => corners[i]), ["vertex"])}\nendloop\nendfacet`;
  const binary = Buffer.alloc(84 + 50 * triangles.length);
  binary.writeUInt32LE(triangles.length, 80);
  triangles.forEach((triangle, k) => triangle.flatMap((i) => corners[i]).forEach((x, at) => binary.writeFloatLE(Number(x), 96 + 50 * k + 4 * at)));
  const header = `element vertex 8\nproperty float x\nproperty float y\nproperty float z\nelement face 6\nproperty list uchar int vertex_indices`;
  return {
    "text.stl": `solid box\n${triangles.map(facet).join("\n")}\nendsolid box\n`,
    "binary.stl": binary,
    "box.ply": `ply\nformat ascii 1.0\n${header}\nend_header\n${rows(corners)}\n${rows(faces, [4])}\n`,
    "box.off": `OFF\n8 6 0\n${rows(corners)}\n${rows(faces, [4])}\n`,
    "box.glb": glb(),
  };
}

// The glTF above as a binary file.
function glb() {
  const { buffers, ...scene } = JSON.parse(gltf());
  const bytes = Buffer.from(buffers[0].uri.split(",")[1], "base64");
  const padded = (part, fill) => Buffer.concat([part, Buffer.alloc(-part.length & 3, fill)]);
  const json = padded(Buffer.from(JSON.stringify({ ...scene, buffers: [{ byteLength: bytes.length }] })), " ");
  const chunks = [["JSON", json], ["BIN\0", padded(bytes, 0)]].map(([kind, part]) => {
    const head = Buffer.alloc(8);
    head.writeUInt32LE(part.length, 0);
    head.write(kind, 4, "latin1");
    return Buffer.concat([head, part]);
  });
  const head = Buffer.from("glTF\x02\0\0\0\0\0\0\0", "latin1");
  head.writeUInt32LE(12 + Buffer.concat(chunks).length, 8);
  return Buffer.concat([head, ...chunks]);
}

// Comb on a base, in OBJ. The tines and the gaps are half a pitch wide.
export function comb(tines, pitch) {
  const base = [0, (tines - 0.5) * pitch, 0, 4];
  const solids = [base, ...Array.from({ length: tines }, (_, i) => [i * pitch, (i + 0.5) * pitch, 3, 24])];
  const faces = [[1, 4, 3, 2], [5, 6, 7, 8], [1, 2, 6, 5], [2, 3, 7, 6], [3, 4, 8, 7], [4, 1, 5, 8]];
  const lines = solids.flatMap(([left, right, bottom, top], solid) => [
    ...[bottom, top].flatMap((z) => [[left, 0], [right, 0], [right, 8], [left, 8]].map(([x, y]) => `v ${x} ${y} ${z}`)),
    ...faces.map((corners) => `f ${corners.map((corner) => 8 * solid + corner).join(" ")}`),
  ]);
  return lines.join("\n");
}

// Ribbed bottle with the given number of triangles (a multiple of 400).
export function bottle(triangles) {
  const [around, along] = [200, triangles / 400];
  const radius = (v) => 0.03 + 0.004 * Math.sin(20 * v) - 0.012 * Math.max(0, v - 0.7) / 0.3;
  const point = (i, j) => {
    const [u, v] = [(2 * Math.PI * i) / around, j / along];
    return [radius(v) * Math.cos(u), radius(v) * Math.sin(u), 0.18 * v].map((x) => x.toFixed(6)).join(" ");
  };
  const lines = [];
  for (let j = 0; j <= along; j++) for (let i = 0; i < around; i++) lines.push(`v ${point(i, j)}`);
  const name = (i, j) => j * around + (i % around) + 1;
  for (let j = 0; j < along; j++) {
    for (let i = 0; i < around; i++) {
      lines.push(`f ${name(i, j)} ${name(i + 1, j)} ${name(i + 1, j + 1)}`, `f ${name(i, j)} ${name(i + 1, j + 1)} ${name(i, j + 1)}`);
    }
  }
  return lines.join("\n");
}
