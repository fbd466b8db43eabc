// Bringing one's own mesh, good and bad.

import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { open, screenshot, untilReady, visit } from "./chromium.js";

let served;
before(async () => (served = await open()));
after(() => served?.close());

// A box of 40 x 60 x 120, without a unit as OBJ files are.
const BOX = `v 0 0 0\nv 40 0 0\nv 40 60 0\nv 0 60 0\nv 0 0 120\nv 40 0 120\nv 40 60 120\nv 0 60 120
f 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n`;

function file(name, text) {
  return { name, mimeType: "application/octet-stream", buffer: Buffer.from(text) };
}

test("a mesh is read, measured, and its unit set right", async () => {
  const { page } = await visit(served);
  await untilReady(page);
  await page.setInputFiles("#file", file("box.obj", BOX));
  await page.waitForFunction(() => document.getElementById("report-size").textContent === "4.0 × 6.0 × 12.0 cm");
  assert.equal(await page.getAttribute("#unit-choice [value=mm]", "aria-pressed"), "true");
  await screenshot(page, "upload");
  await page.selectOption("#speed", "4");
  await page.click("#grasp");
  await page.waitForSelector("[data-phase=verdict].is-now");
  assert.match(await page.textContent("#hash"), /^Seed 0 /);
  assert.match(await page.textContent("#tally"), /^[01] of 1 lifted$/);
  await screenshot(page, "upload-verdict");
  await page.click("#unit-choice [value=in]");
  await page.waitForFunction(() => document.getElementById("report-size").textContent.startsWith("101.6"));
  await page.close();
});

// A binary PLY file of three million triangles over a handful of vertices.
function large() {
  const head = `ply\nformat binary_little_endian 1.0\nelement vertex 4\nproperty uchar x\nproperty uchar y\nproperty uchar z
element face 3000000\nproperty list uchar uint vertex_indices\nend_header\n`;
  const vertices = Buffer.from([0, 0, 0, 9, 0, 0, 0, 9, 0, 0, 0, 9]);
  const face = Buffer.alloc(13);
  face.writeUInt8(3, 0);
  [0, 1, 2].forEach((index, corner) => face.writeUInt32LE(index, 1 + 4 * corner));
  return Buffer.concat([Buffer.from(head), vertices, Buffer.alloc(13 * 3_000_000, face)]);
}

test("bad files each say what is wrong, and the scene goes on", async () => {
  const { page, complaints } = await visit(served);
  await untilReady(page);
  const size = await page.textContent("#report-size");
  for (const [name, text, cause] of [
    ["empty.stl", "", /empty/],
    ["cut.obj", BOX.slice(0, 60), /no faces|ends early/],
    ["nan.obj", BOX.replace("v 40 0 0", "v nan 0 0"), /coordinate/],
    ["flat.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", /area/],
    ["letter.obj", "Dear reader, this is no mesh.\n", /not a mesh|expected/],
    ["picture.obj", Buffer.from("\x89PNG\r\n\x1a\n0000000000000000", "latin1"), /looks like/],
    ["large.ply", large(), /at most 2000000/],
  ]) {
    await page.setInputFiles("#file", file(name, text));
    const card = await page.waitForSelector(`.failure:has-text("${name}")`);
    assert.match(await card.textContent(), cause);
    assert.equal(await page.textContent("#report-size"), size, "the object before still stands there");
  }
  await screenshot(page, "failure");
  await page.click(".failure .close");
  assert.equal(await page.locator(".failure").count(), 0);
  const before = await page.inputValue("#pose-x");
  await page.click("#new-pose");
  await page.waitForFunction((x) => document.getElementById("pose-x").value !== x, before);
  assert.deepEqual(complaints, []);
  await page.close();
});
