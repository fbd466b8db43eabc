// Upload of meshes: import, options, orientation, storage, errors.

import assert from "node:assert/strict";
import { mkdirSync, mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { setTimeout } from "node:timers/promises";
import { deflateRawSync } from "node:zlib";
import { newPage, open, TIMEOUT_MS, screenshot, untilReady, visit } from "./chromium.js";
import { BOX, bottle, comb, gltf, otherFormats } from "./meshes.js";

let served;
before(async () => (served = await open()));
after(() => served?.close());

function file(name, text) {
  return { name, mimeType: "application/octet-stream", buffer: Buffer.from(text) };
}

// Waits until the browser's mesh store fulfils a condition; it is updated after the page.
async function untilStored(page, name, condition) {
  const stored = () =>
    page.evaluate(async (name) => {
      const result = (request) => new Promise((resolve) => (request.onsuccess = () => resolve(request.result)));
      const database = await result(indexedDB.open("ngf-grasp"));
      const entry = await result(database.transaction("meshes").objectStore("meshes").get(name));
      database.close();
      return entry && { options: entry.options, text: await entry.file.text() };
    }, name);
  for (const until = Date.now() + 30_000; Date.now() < until; await setTimeout(50)) {
    const entry = await stored();
    if (condition(entry)) return;
  }
  assert.fail(`unexpected entry of ${name} in the mesh store`);
}

// Uploads the box and sets its mass to 250 g.
async function uploadWith250Grams(page) {
  await page.setInputFiles("#file", file("box.obj", BOX));
  await page.waitForFunction(() => document.getElementById("info-mass").textContent === "173 g");
  await page.fill("#mass", "250");
  await page.press("#mass", "Tab");
  await page.waitForFunction(() => document.getElementById("info-mass").textContent === "250 g");
}

test("mesh is imported and measured, and its unit can be changed", async () => {
  const { page } = await visit(served);
  await untilReady(page);
  await page.setInputFiles("#file", file("box.obj", BOX));
  await page.waitForFunction(() => document.getElementById("info-size").textContent === "4.0 × 6.0 × 12.0 cm");
  assert.equal(await page.getAttribute("#unit-choice [value=mm]", "aria-pressed"), "true");
  await screenshot(page, "upload");
  await page.selectOption("#speed", "4");
  await page.click("#grasp");
  await page.waitForSelector("[data-phase=outcome].is-now");
  assert.match(await page.textContent("#hash"), /^Seed 0\. /);
  assert.match(await page.textContent("#tally"), /^[01] of 1 lifted$/);
  await screenshot(page, "upload-outcome");
  await page.click("#unit-choice [value=in]");
  await page.waitForFunction(() => document.getElementById("info-size").textContent.startsWith("101.6"));
  await page.close();
});

test("mass and orientation can be changed", async () => {
  const { page } = await visit(served);
  await untilReady(page);
  await page.setInputFiles("#file", file("box.obj", BOX));
  await page.waitForFunction(() => document.getElementById("info-size").textContent === "4.0 × 6.0 × 12.0 cm");
  assert.equal(await page.inputValue("#mass"), "173", "600 kg/m³");
  assert.match(await page.textContent("#info-hand"), /^4\.0 cm at its narrowest: fits the hand$/);
  await page.fill("#mass", "250");
  await page.press("#mass", "Tab");
  await page.waitForFunction(() => document.getElementById("info-mass").textContent === "250 g");
  assert.ok(!/estimated|clamped/.test(await page.textContent("#info-notes")));
  await page.selectOption("#orientation", "0");
  await page.waitForFunction(() => document.getElementById("info-size").textContent.endsWith("× 4.0 cm"));
  assert.equal(await page.textContent("#info-mass"), "250 g", "the mass is kept");
  await page.close();
});

test("hollows that the convex parts fill are noted", async () => {
  const { page, errors } = await visit(served);
  await untilReady(page);
  const note = "#info-notes li:has-text('of the hollows')";
  await page.setInputFiles("#file", file("comb.obj", comb(41, 4)));
  const text = await page.textContent(note);
  assert.match(text, /^The convex parts fill \d+ % of the hollows, where the fingers cannot enter\.$/);
  // 24 parts leave up to 23 of the 40 gaps free.
  const percent = Number(text.match(/\d+/)[0]);
  assert.ok(percent >= 35 && percent <= 100, text);
  await screenshot(page, "upload-hollows");
  // Three parts leave the gap of a bracket free.
  await page.setInputFiles("#file", file("bracket.obj", comb(2, 60)));
  await page.waitForSelector("#objects [value='file:bracket.obj']:checked");
  await page.waitForSelector(note, { state: "detached" });
  assert.match(await page.textContent("#info-mesh"), / [2-9] convex parts$/);
  assert.deepEqual(errors, []);
  await page.close();
});

test("attempt started right after a mass change uses the new mass", async () => {
  const { page, errors } = await visit(served);
  await untilReady(page);
  await page.selectOption("#speed", "4");
  await page.setInputFiles("#file", file("box.obj", BOX));
  await page.waitForFunction(() => document.getElementById("info-mass").textContent === "173 g");
  // The click itself commits the mass.
  await page.fill("#mass", "250");
  await page.click("#grasp");
  await page.waitForSelector("[data-phase=outcome].is-now", { timeout: TIMEOUT_MS });
  assert.equal(await page.textContent("#info-mass"), "250 g");
  assert.match(await page.textContent("#tally"), /of 1/);
  assert.deepEqual(errors, []);
  await page.close();
});

test("batch started right after a mass change uses the new mass", async () => {
  const { page, errors } = await visit(served);
  await untilReady(page);
  await page.setInputFiles("#file", file("box.obj", BOX));
  await page.waitForFunction(() => document.getElementById("info-mass").textContent === "173 g");
  await page.fill("#mass", "250");
  await page.click("#batch-run");
  await page.waitForFunction(() => / of [1-9]/.test(document.getElementById("batch-summary").textContent));
  assert.equal(await page.textContent("#info-mass"), "250 g");
  await page.click("#batch-run");
  assert.deepEqual(errors, []);
  await page.close();
});

test("mesh is selected when it is dropped with a JSON file", async () => {
  const { page } = await visit(served);
  await untilReady(page);
  await page.setInputFiles("#file", [file("about.json", "{}"), file("box.obj", BOX)]);
  await page.waitForFunction(() => document.getElementById("info-size").textContent === "4.0 × 6.0 × 12.0 cm");
  assert.equal(await page.locator("#failures .failure").count(), 0);
  // An invalid mass is reset.
  await page.fill("#mass", "0");
  await page.press("#mass", "Tab");
  await page.waitForFunction(() => document.getElementById("mass").value === "173");
  await page.close();
});

// ZIP archive with the given files, deflated.
function zip(files) {
  const parts = [];
  const list = [];
  let at = 0;
  for (const [name, text] of Object.entries(files)) {
    const content = Buffer.from(text);
    const packed = deflateRawSync(content);
    const local = Buffer.alloc(30);
    local.writeUInt32LE(0x04034b50, 0);
    local.writeUInt16LE(8, 8);
    local.writeUInt32LE(packed.length, 18);
    local.writeUInt32LE(content.length, 22);
    local.writeUInt16LE(name.length, 26);
    const entry = Buffer.alloc(46);
    entry.writeUInt32LE(0x02014b50, 0);
    entry.writeUInt16LE(8, 10);
    entry.writeUInt32LE(packed.length, 20);
    entry.writeUInt32LE(content.length, 24);
    entry.writeUInt16LE(name.length, 28);
    entry.writeUInt32LE(at, 42);
    parts.push(local, Buffer.from(name), packed);
    list.push(entry, Buffer.from(name));
    at += 30 + name.length + packed.length;
  }
  const end = Buffer.alloc(22);
  end.writeUInt32LE(0x06054b50, 0);
  end.writeUInt16LE(Object.keys(files).length, 8);
  end.writeUInt16LE(Object.keys(files).length, 10);
  end.writeUInt32LE(Buffer.concat(list).length, 12);
  end.writeUInt32LE(at, 16);
  return Buffer.concat([...parts, ...list, end]);
}

test("several files, ZIP archives and pasted files are imported", async () => {
  const { page, errors } = await visit(served);
  await untilReady(page);
  const shown = (name) => page.waitForSelector(`#objects [value='file:${name}']:checked`);
  await page.setInputFiles("#file", [file("one.obj", BOX), file("two.obj", BOX.replaceAll("120", "80"))]);
  await shown("one.obj");
  await page.click("#objects label:has-text('two.obj')");
  await shown("two.obj");
  await page.waitForFunction(() => document.getElementById("info-size").textContent === "4.0 × 6.0 × 8.0 cm");
  await page.setInputFiles("#file", file("four.gltf", gltf()));
  await shown("four.gltf");
  await page.waitForFunction(() => document.getElementById("info-size").textContent === "4.0 × 6.0 × 12.0 cm");
  const archive = zip({ "meshes/three.obj": BOX.replaceAll("120", "70"), "read me.txt": "not a mesh", "__MACOSX/three.obj": "x" });
  await page.setInputFiles("#file", file("meshes.zip", archive));
  await shown("three.obj");
  await page.waitForFunction(() => document.getElementById("info-size").textContent === "4.0 × 6.0 × 7.0 cm");
  const encrypted = Buffer.from(archive);
  encrypted.writeUInt16LE(1, encrypted.indexOf("PK\x01\x02") + 8);
  // The number of files is too large.
  const damaged = Buffer.from(archive);
  damaged.writeUInt16LE(9, damaged.length - 12);
  for (const [name, bytes, message] of [
    ["cut.zip", archive.subarray(0, 100), /cannot be opened: End of central directory not found/],
    ["encrypted.zip", encrypted, /is encrypted/],
    ["damaged.zip", damaged, /cannot be opened/],
    ["letters.zip", zip({ "letter.txt": "Dear reader" }), /contains no OBJ/],
    ["bomb.zip", zip({ "bomb.obj": Buffer.alloc(260e6) }), /larger than 250 MB/],
  ]) {
    await page.setInputFiles("#file", file(name, bytes));
    const card = await page.waitForSelector(`.failure:has-text("${name}")`);
    assert.match(await card.textContent(), message);
  }
  await page.evaluate((text) => {
    const clipboardData = new DataTransfer();
    clipboardData.items.add(new File([text], "pasted.obj"));
    dispatchEvent(new ClipboardEvent("paste", { clipboardData }));
  }, BOX);
  await shown("pasted.obj");
  // An unreadable file is removed from the list.
  await page.setInputFiles("#file", file("bad.obj", "v 1"));
  await page.waitForSelector('.failure:has-text("bad.obj")');
  await shown("pasted.obj");
  assert.equal(await page.locator("#objects [value='file:bad.obj']").count(), 0);
  assert.deepEqual(errors, []);
  await page.close();
});

test("glTF is imported with its buffers from other files and from a ZIP archive", async () => {
  const { page, errors } = await visit(served);
  await untilReady(page);
  const { buffers, ...scene } = JSON.parse(gltf());
  const bytes = Buffer.from(buffers[0].uri.split(",")[1], "base64");
  const json = JSON.stringify({ ...scene, buffers: [{ byteLength: bytes.length, uri: "my%20data.bin" }] });
  const isShown = (name) => page.waitForSelector(`#objects [value='file:${name}']:checked`);
  await page.setInputFiles("#file", [file("split.gltf", json), file("my data.bin", bytes)]);
  await isShown("split.gltf");
  await page.waitForFunction(() => document.getElementById("info-size").textContent === "4.0 × 6.0 × 12.0 cm");
  await page.setInputFiles("#file", file("packed.zip", zip({ "._scene.gltf": "x", "scene.gltf": json, "my data.bin": bytes })));
  await isShown("scene.gltf");
  assert.equal(await page.locator(".failure").count(), 0);
  // The first buffer is embedded, the second in a file, and a third one, which no mesh uses, is missing.
  const bufferViews = scene.bufferViews.map((view, i) => ({ ...view, buffer: i % 2 }));
  const mixedBuffers = [...buffers, { byteLength: bytes.length, uri: "my data.bin" }, { byteLength: 4, uri: "animation.bin" }];
  const mixed = JSON.stringify({ ...scene, bufferViews, buffers: mixedBuffers });
  await page.setInputFiles("#file", [file("mixed.gltf", mixed), file("my data.bin", bytes)]);
  await isShown("mixed.gltf");
  assert.equal(await page.locator(".failure").count(), 0);
  await page.setInputFiles("#file", file("alone.gltf", json));
  const card = await page.waitForSelector('.failure:has-text("alone.gltf")');
  assert.match(await card.textContent(), /my%20data\.bin/);
  assert.deepEqual(errors, []);
  await page.close();
});

test("mesh of unit size asks for its size", async () => {
  const { page, errors } = await visit(served);
  await untilReady(page);
  await page.setInputFiles("#file", file("unit.obj", BOX.replaceAll("120", "1").replaceAll("60", "0.5").replaceAll("40", "0.25")));
  await page.waitForSelector('.failure[data-code="size_required"]');
  await page.fill(".size-form input", "16");
  await page.click(".size-form button");
  await page.waitForFunction(() => document.getElementById("info-size").textContent === "4.0 × 8.0 × 16.0 cm");
  assert.equal(await page.locator(".failure").count(), 0);
  assert.equal(await page.inputValue("#longest-side"), "16.0");
  await page.fill("#longest-side", "12");
  await page.press("#longest-side", "Tab");
  await page.waitForFunction(() => document.getElementById("info-size").textContent === "3.0 × 6.0 × 12.0 cm");
  assert.deepEqual(errors, []);
  await page.close();
});

test("dropped folder is imported with all mesh formats", async (t) => {
  const folder = mkdtempSync(join(tmpdir(), "meshes-"));
  t.after(() => rmSync(folder, { recursive: true }));
  mkdirSync(join(folder, "deeper"));
  const meshes = otherFormats();
  Object.entries(meshes).forEach(([name, bytes], k) => writeFileSync(join(folder, k % 2 ? "deeper" : ".", name), bytes));
  writeFileSync(join(folder, "notes.txt"), "not a mesh");
  const { page, errors } = await visit(served);
  await untilReady(page);
  const session = await page.context().newCDPSession(page);
  const data = { items: [], files: [folder], dragOperationsMask: 1 };
  for (const type of ["dragEnter", "dragOver"]) await session.send("Input.dispatchDragEvent", { type, x: 400, y: 300, data });
  await page.waitForSelector("#drop", { state: "visible" });
  await session.send("Input.dispatchDragEvent", { type: "drop", x: 400, y: 300, data });
  await page.waitForSelector("#drop", { state: "hidden" });
  // Selecting the same folder with the button adds no entries.
  const [chooser] = await Promise.all([page.waitForEvent("filechooser"), page.click("#upload-folder")]);
  await chooser.setFiles(folder);
  await page.waitForFunction(() => document.querySelectorAll("#objects [value^='file:']").length === 5);
  for (const name of Object.keys(meshes)) {
    await page.click("#objects label:has-text('Sugar box')");
    await page.waitForFunction(() => document.getElementById("info-size").textContent === "4.9 × 9.4 × 17.6 cm");
    await page.click(`#objects label:has-text('${name}')`);
    await page.waitForFunction(() => document.getElementById("info-size").textContent === "4.0 × 6.0 × 12.0 cm");
  }
  assert.equal(await page.locator("#objects [value^='file:']").count(), Object.keys(meshes).length);
  assert.deepEqual(errors, []);
  await page.close();
});

test("only the first 50 files are added, which is reported", async () => {
  const { page } = await visit(served);
  await untilReady(page);
  await page.setInputFiles("#file", Array.from({ length: 51 }, (_, i) => file(`${i}.obj`, BOX)));
  await page.waitForSelector("[data-code=files_skipped]");
  assert.equal(await page.locator("#objects [value^='file:']").count(), 50);
  await page.close();
});

// Writes a file to the disk: Playwright transfers up to 50 MB from memory.
function onDisk(t, name, bytes) {
  const folder = mkdtempSync(join(tmpdir(), "meshes-"));
  t.after(() => rmSync(folder, { recursive: true }));
  writeFileSync(join(folder, name), bytes);
  return join(folder, name);
}

// Binary PLY file with six million triangles and four vertices.
function largePly() {
  const head = `ply\nformat binary_little_endian 1.0\nelement vertex 4\nproperty uchar x\nproperty uchar y\nproperty uchar z
element face 6000000\nproperty list uchar uint vertex_indices\nend_header\n`;
  const vertices = Buffer.from([0, 0, 0, 9, 0, 0, 0, 9, 0, 0, 0, 9]);
  const face = Buffer.alloc(13);
  face.writeUInt8(3, 0);
  [0, 1, 2].forEach((index, corner) => face.writeUInt32LE(index, 1 + 4 * corner));
  return Buffer.concat([Buffer.from(head), vertices, Buffer.alloc(13 * 6_000_000, face)]);
}

// Box on an edge: unstable in the orientation of its file.
const TILTED = BOX.replace("v 40 60 0", "v 40 60 90").replace("v 40 0 0", "v 40 0 90");
const REORIENTED = "#info-notes li:has-text('the stable pose most similar to the training data is used instead')";

test("unstable mesh gets the stable pose most similar to the training data", async () => {
  const { page, errors } = await visit(served);
  await untilReady(page);
  await page.waitForFunction(() => /^Loaded/.test(document.getElementById("model").textContent));
  await page.setInputFiles("#file", file("tilted.obj", TILTED));
  await page.waitForSelector(REORIENTED);
  const size = await page.textContent("#info-size");
  assert.notEqual(await page.inputValue("#orientation"), "0");
  // A new mass keeps the orientation. A second worker, with another policy or none, uses the same one.
  await page.fill("#mass", "300");
  await page.press("#mass", "Enter");
  await page.waitForFunction(() => document.getElementById("info-mass").textContent === "300 g");
  assert.equal(await page.textContent("#info-size"), size);
  await page.click("#search");
  await page.waitForFunction(() => /selected|none robust/.test(document.getElementById("search-status").textContent));
  assert.equal(await page.locator("[data-code=grasp_object_mismatch]").count(), 0);
  // The user can override the orientation.
  await page.selectOption("#orientation", "0");
  await page.waitForFunction((size) => document.getElementById("info-size").textContent !== size, size);
  // A second policy runs an attempt that was started during the import, with the same orientation.
  await page.focus("#compare");
  await page.waitForSelector("#compare [value=default]", { state: "attached" });
  await page.selectOption("#compare", "default");
  await page.waitForFunction(() => document.getElementById("policy-name-2").textContent === "default");
  await page.selectOption("#speed", "4");
  await page.evaluate(async (text) => {
    const input = document.getElementById("file");
    const files = new DataTransfer();
    // Long enough that the import is still in progress.
    files.items.add(new File([text, "# comment\n".repeat(1e6)], "tilted.obj"));
    input.files = files.files;
    input.dispatchEvent(new Event("change"));
    await new Promise((resolve) => setTimeout(resolve, 1));
    document.getElementById("grasp").click();
  }, TILTED);
  await page.waitForFunction(() => ["policy-name-1", "policy-name-2"].every((id) => /^default: [A-Z]/.test(document.getElementById(id).textContent)));
  assert.equal(await page.textContent("#policy-name-1"), await page.textContent("#policy-name-2"));
  assert.deepEqual(errors, []);
  await page.close();
});

test("mesh uploaded before the policy is reoriented once the policy is loaded", async () => {
  const { page } = await newPage(served);
  let release = () => {};
  const released = new Promise((resolve) => (release = resolve));
  await page.route("**/weights**", async (route) => {
    await released;
    await route.continue();
  });
  await page.goto(served.address);
  await page.waitForSelector("#upload:enabled");
  await page.setInputFiles("#file", file("tilted.obj", TILTED));
  await page.waitForSelector("#info-notes li:has-text('the most stable pose is used instead')");
  release();
  await page.waitForSelector(REORIENTED);
  await page.close();
});

// Binary STL file of a sphere (mm): rings of quadrilaterals of two triangles each.
function sphere(radius, rings) {
  const round = 2 * rings;
  const at = (ring, k) => {
    const [polar, azimuth] = [(Math.PI * ring) / rings, (Math.PI * (k % round)) / rings];
    return [Math.sin(polar) * Math.cos(azimuth), Math.sin(polar) * Math.sin(azimuth), Math.cos(polar)].map((x) => radius * x);
  };
  const bytes = Buffer.alloc(84 + 100 * rings * round);
  bytes.writeUInt32LE(2 * rings * round, 80);
  const corners = new Float32Array(9);
  for (let ring = 0, to = 84; ring < rings; ring++) {
    for (let k = 0; k < round; k++) {
      const [a, b, c, d] = [at(ring, k), at(ring, k + 1), at(ring + 1, k), at(ring + 1, k + 1)];
      for (const triangle of [[a, c, d], [a, d, b]]) {
        corners.set(triangle.flat());
        bytes.set(new Uint8Array(corners.buffer), to + 12);
        to += 50;
      }
    }
  }
  return bytes;
}

test("large mesh is simplified, which is reported", async (t) => {
  const { page, errors } = await visit(served);
  await untilReady(page);
  const start = performance.now();
  await page.setInputFiles("#file", onDisk(t, "sphere.stl", sphere(35, 600)));
  await page.waitForFunction(() => document.getElementById("info-size").textContent === "7.0 × 7.0 × 7.0 cm");
  t.diagnostic(`${((performance.now() - start) / 1000).toFixed(1)} s to import 1,440,000 triangles`);
  assert.match(await page.textContent("#info-notes"), /Simplified from 1440000 triangles \(max\. deviation 0\.[1-4] mm\)\./);
  await page.selectOption("#speed", "4");
  await page.click("#grasp");
  await page.waitForSelector("[data-phase=outcome].is-now");
  assert.deepEqual(errors, []);
  await page.close();
});

test("invalid files are reported and do not affect the scene", async (t) => {
  const { page, errors } = await visit(served);
  await untilReady(page);
  const size = await page.textContent("#info-size");
  for (const [name, text, message] of [
    ["empty.stl", "", /empty/],
    ["cut.obj", BOX.slice(0, 60), /no faces|ends early/],
    ["nan.obj", BOX.replace("v 40 0 0", "v nan 0 0"), /coordinate/],
    ["flat.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", /area/],
    ["letter.obj", "Dear reader, this is a letter.\n", /not a mesh|expected/],
    ["picture.obj", Buffer.from("\x89PNG\r\n\x1a\n0000000000000000", "latin1"), /looks like/],
    ["large.ply", largePly(), /5000000/],
  ]) {
    await page.setInputFiles("#file", name === "large.ply" ? onDisk(t, name, text) : file(name, text));
    const card = await page.waitForSelector(`.failure:has-text("${name}")`);
    assert.match(await card.textContent(), message);
    assert.equal(await page.textContent("#info-size"), size, "the object is unchanged");
  }
  await screenshot(page, "failure");
  await page.click(".failure .close");
  assert.equal(await page.locator(".failure").count(), 0);
  const before = await page.inputValue("#pose-x");
  await page.click("#new-pose");
  await page.waitForFunction((x) => document.getElementById("pose-x").value !== x, before);
  assert.deepEqual(errors, []);
  await page.close();
});

test("slow import can be cancelled, and the scene is unchanged", async () => {
  const { page, errors } = await visit(served);
  await untilReady(page);
  const size = await page.textContent("#info-size");
  await page.selectOption("#compare", "default");
  await page.setInputFiles("#file", file("long.obj", bottle(400_000)));
  // The progress label shows the import step.
  await page.waitForFunction(() => /^(Computing stable poses of|Decomposing) long\.obj /.test(document.getElementById("progress-label").textContent));
  await page.click("#progress-stop");
  await untilReady(page);
  assert.ok(await page.isHidden("#progress"));
  assert.equal(await page.textContent("#info-size"), size);
  assert.ok(await page.isChecked("#objects [value=sugar_box]"));
  assert.equal(await page.locator("#objects [value='file:long.obj']").count(), 0);
  // The next upload works.
  await page.setInputFiles("#file", file("box.obj", BOX));
  await page.waitForFunction(() => document.getElementById("info-size").textContent === "4.0 × 6.0 × 12.0 cm");
  assert.deepEqual(errors, []);
  await page.close();
});

test("unreadable file keeps the existing file of that name, a readable one replaces it", async () => {
  const { page, errors } = await visit(served);
  await untilReady(page);
  const entry = "#objects [value='file:box.obj']";
  const height = (cm) => page.waitForFunction((cm) => document.getElementById("info-size").textContent === `4.0 × 6.0 × ${cm} cm`, cm);
  const reselect = async (cm) => {
    await page.click("#objects label:has-text('Sugar box')");
    await page.waitForFunction(() => document.getElementById("info-size").textContent === "4.9 × 9.4 × 17.6 cm");
    await page.click("#objects label:has-text('box.obj')");
    await height(cm);
  };
  await page.setInputFiles("#file", file("box.obj", BOX));
  await height("12.0");
  await page.setInputFiles("#file", file("box.obj", "v 1"));
  await page.waitForSelector('.failure:has-text("box.obj")');
  await page.click(".failure .close");
  await page.waitForSelector(`${entry}:checked`);
  assert.equal(await page.locator(entry).count(), 1);
  await reselect("12.0");
  await page.reload();
  await untilReady(page);
  await reselect("12.0");
  await page.setInputFiles("#file", file("box.obj", BOX.replaceAll("120", "80")));
  await height("8.0");
  assert.equal(await page.locator(entry).count(), 1);
  await untilStored(page, "box.obj", (stored) => stored?.text.includes("80"));
  await page.reload();
  await untilReady(page);
  await reselect("8.0");
  // Files with the same name in an archive get distinct names.
  await page.setInputFiles("#file", file("parts.zip", zip({ "a/part.obj": BOX, "b/part.obj": BOX.replaceAll("120", "70") })));
  await height("12.0");
  await page.click("#objects label:has-text('part (2).obj')");
  await height("7.0");
  assert.deepEqual(errors, []);
  await page.close();
});

test("import options are kept until the next visit", async () => {
  const { page, errors } = await visit(served);
  await untilReady(page);
  await uploadWith250Grams(page);
  await page.selectOption("#orientation", "0");
  await page.waitForFunction(() => document.getElementById("info-size").textContent.endsWith("× 4.0 cm"));
  await untilStored(page, "box.obj", (stored) => stored?.options?.orientation?.stablePose === 0);
  await page.reload();
  await untilReady(page);
  await page.click("#objects label:has-text('box.obj')");
  await page.waitForFunction(() => document.getElementById("info-size").textContent.endsWith("× 4.0 cm"));
  assert.equal(await page.textContent("#info-mass"), "250 g");
  assert.deepEqual(errors, []);
  await page.close();
});

test("mesh that exceeds the browser storage stays until the page is closed, which is reported", async () => {
  const { page, errors } = await newPage(served);
  await page.addInitScript(() => {
    IDBObjectStore.prototype.put = () => {
      throw new DOMException("quota exceeded", "QuotaExceededError");
    };
  });
  await page.goto(served.address);
  await untilReady(page);
  await page.setInputFiles("#file", file("box.obj", BOX));
  assert.match(await page.textContent("[data-code=mesh_not_stored]"), /box\.obj could not be stored/);
  await page.waitForSelector("#objects label:has-text('box.obj') :checked");
  assert.equal(await page.textContent("#info-size"), "4.0 × 6.0 × 12.0 cm");
  await page.reload();
  await untilReady(page);
  assert.equal(await page.locator("#objects label:has-text('box.obj')").count(), 0);
  assert.deepEqual(errors, []);
  await page.close();
});

test("share link of another file keeps the import options of stored files", async () => {
  const { page, errors } = await visit(served);
  await untilReady(page);
  await uploadWith250Grams(page);
  await untilStored(page, "box.obj", (stored) => stored?.options?.massKg === 0.25);
  const link = (unit) => `#v=1&o=other.stl&oh=0&u=${unit}&kg=0.7&p=0.6,0,0&s=0&m=default&sc=0&h=0`;
  await page.goto("about:blank");
  await page.goto(served.address + link("m"));
  await page.waitForSelector("[data-code=link_needs_file]");
  await untilReady(page);
  await page.click("#objects label:has-text('box.obj')");
  await page.waitForFunction(() => document.getElementById("info-size").textContent === "4.0 × 6.0 × 12.0 cm");
  assert.equal(await page.textContent("#info-mass"), "250 g");
  await untilStored(page, "box.obj", (stored) => stored?.options?.massKg === 0.25);
  // A link with an invalid field is rejected.
  await page.goto("about:blank");
  await page.goto(served.address + link("ell"));
  assert.match(await page.textContent("[data-code=invalid_link]"), /"u" has the invalid value "ell"/);
  assert.deepEqual(errors, []);
  await page.close();
});

test("simultaneous changes of mass and orientation are both applied", async () => {
  const { page, errors } = await visit(served);
  await untilReady(page);
  await page.setInputFiles("#file", file("box.obj", BOX));
  await page.waitForFunction(() => document.getElementById("info-mass").textContent === "173 g");
  await page.evaluate(() => {
    const set = (id, value) => {
      const field = document.getElementById(id);
      field.value = value;
      field.dispatchEvent(new Event("change", { bubbles: true }));
    };
    set("mass", "250");
    set("orientation", "0");
  });
  await page.waitForFunction(() => document.getElementById("info-size").textContent.endsWith("× 4.0 cm"));
  assert.equal(await page.textContent("#info-mass"), "250 g");
  assert.deepEqual(errors, []);
  await page.close();
});

test("mesh is stored until the next visit and can be removed", async () => {
  const { page, errors } = await visit(served);
  await untilReady(page);
  const entry = "#objects [value='file:box.obj']";
  await page.setInputFiles("#file", [file("box.obj", BOX), file("bad.obj", "v 1")]);
  await page.waitForSelector(`${entry}:checked`);
  await page.click("#objects label:has-text('bad.obj')");
  await page.waitForSelector('.failure:has-text("bad.obj")');
  await untilStored(page, "box.obj", (stored) => stored);
  await untilStored(page, "bad.obj", (stored) => !stored);
  await page.reload();
  await untilReady(page);
  await page.waitForSelector(entry, { state: "attached" });
  assert.equal(await page.locator("#objects [value='file:bad.obj']").count(), 0, "unreadable files are not stored");
  assert.ok(await page.isHidden("#remove"), "the mesh is not selected");
  await page.click("#objects label:has-text('box.obj')");
  await page.waitForFunction(() => document.getElementById("info-size").textContent === "4.0 × 6.0 × 12.0 cm");
  await screenshot(page, "upload-stored");
  await page.click("#remove");
  await page.waitForFunction(() => document.getElementById("info-size").textContent !== "4.0 × 6.0 × 12.0 cm");
  assert.equal(await page.locator(entry).count(), 0);
  assert.ok(await page.isHidden("#remove"));
  await untilStored(page, "box.obj", (stored) => !stored);
  await page.reload();
  await untilReady(page);
  await page.waitForTimeout(500);
  assert.equal(await page.locator(entry).count(), 0);
  assert.deepEqual(errors, []);
  await page.close();
});
