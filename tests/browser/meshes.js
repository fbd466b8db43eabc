// Meshes to bring to the page, as OBJ files.

// A box of 40 x 60 x 120, without a unit as OBJ files are.
export const BOX = `v 0 0 0\nv 40 0 0\nv 40 60 0\nv 0 60 0\nv 0 0 120\nv 40 0 120\nv 40 60 120\nv 0 60 120
f 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n`;

// A bottle with ribs, of so many triangles.
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
