// Bringing one's own mesh, good and bad.

import assert from "node:assert/strict";
import { mkdirSync, mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { setTimeout } from "node:timers/promises";
import { deflateRawSync } from "node:zlib";
import { blank, open, PATIENCE, screenshot, untilReady, visit } from "./chromium.js";
import { BOX, bottle, gltf, others } from "./meshes.js";

let served;
before(async () => (served = await open()));
after(() => served?.close());

function file(name, text) {
  return { name, mimeType: "application/octet-stream", buffer: Buffer.from(text) };
}

// What is kept comes to the browser's store, and goes from it, a moment after the page shows it.
async function untilKept(page, name, holds) {
  const kept = () =>
    page.evaluate(async (name) => {
      const answer = (request) => new Promise((resolve) => (request.onsuccess = () => resolve(request.result)));
      const database = await answer(indexedDB.open("ngf-grasp"));
      const one = await answer(database.transaction("meshes").objectStore("meshes").get(name));
      database.close();
      return one && { told: one.told, text: await one.file.text() };
    }, name);
  for (const until = Date.now() + 30_000; Date.now() < until; await setTimeout(50)) {
    const one = await kept();
    if (holds(one)) return;
  }
  assert.fail(`the store does not say of ${name} what it should`);
}

// The box, and that it weighs more than was guessed.
async function bringOf250Grams(page) {
  await page.setInputFiles("#file", file("box.obj", BOX));
  await page.waitForFunction(() => document.getElementById("report-mass").textContent === "173 g");
  await page.fill("#mass", "250");
  await page.press("#mass", "Tab");
  await page.waitForFunction(() => document.getElementById("report-mass").textContent === "250 g");
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

test("mass and side are said, and the object is another one then", async () => {
  const { page } = await visit(served);
  await untilReady(page);
  await page.setInputFiles("#file", file("box.obj", BOX));
  await page.waitForFunction(() => document.getElementById("report-size").textContent === "4.0 × 6.0 × 12.0 cm");
  assert.equal(await page.inputValue("#mass"), "173", "600 kg/m³");
  assert.match(await page.textContent("#report-fits"), /^4\.0 cm across .* gets round it$/);
  await page.fill("#mass", "250");
  await page.press("#mass", "Tab");
  await page.waitForFunction(() => document.getElementById("report-mass").textContent === "250 g");
  assert.ok(!/assumed/.test(await page.textContent("#report-notes")));
  await page.selectOption("#sides", "0");
  await page.waitForFunction(() => document.getElementById("report-size").textContent.endsWith("× 4.0 cm"));
  assert.equal(await page.textContent("#report-mass"), "250 g", "what was said before still holds");
  await page.close();
});

test("a grasp that is asked for right after the mass is of the object that weighs that", async () => {
  const { page, complaints } = await visit(served);
  await untilReady(page);
  await page.selectOption("#speed", "4");
  await page.setInputFiles("#file", file("box.obj", BOX));
  await page.waitForFunction(() => document.getElementById("report-mass").textContent === "173 g");
  // The mass is not confirmed but by the click itself.
  await page.fill("#mass", "250");
  await page.click("#grasp");
  await page.waitForSelector("[data-phase=verdict].is-now", { timeout: PATIENCE });
  assert.equal(await page.textContent("#report-mass"), "250 g");
  assert.match(await page.textContent("#tally"), /of 1/);
  assert.deepEqual(complaints, []);
  await page.close();
});

test("a row of attempts that is asked for right after the mass is of the object that weighs that", async () => {
  const { page, complaints } = await visit(served);
  await untilReady(page);
  await page.setInputFiles("#file", file("box.obj", BOX));
  await page.waitForFunction(() => document.getElementById("report-mass").textContent === "173 g");
  await page.fill("#mass", "250");
  await page.click("#batch-run");
  await page.waitForFunction(() => / of [1-9]/.test(document.getElementById("batch-words").textContent));
  assert.equal(await page.textContent("#report-mass"), "250 g");
  await page.click("#batch-run");
  assert.deepEqual(complaints, []);
  await page.close();
});

test("of a mesh and what is said of it in a file of its own the mesh is shown", async () => {
  const { page } = await visit(served);
  await untilReady(page);
  await page.setInputFiles("#file", [file("about.json", "{}"), file("box.obj", BOX)]);
  await page.waitForFunction(() => document.getElementById("report-size").textContent === "4.0 × 6.0 × 12.0 cm");
  assert.equal(await page.locator("#failures .failure").count(), 0);
  // What is no mass is not left standing.
  await page.fill("#mass", "0");
  await page.press("#mass", "Tab");
  await page.waitForFunction(() => document.getElementById("mass").value === "173");
  await page.close();
});

// An archive of these files, deflated.
function zip(files) {
  const parts = [];
  const list = [];
  let at = 0;
  for (const [name, text] of Object.entries(files)) {
    const packed = deflateRawSync(Buffer.from(text));
    const local = Buffer.alloc(30);
    local.writeUInt32LE(0x04034b50, 0);
    local.writeUInt16LE(8, 8);
    local.writeUInt32LE(packed.length, 18);
    local.writeUInt16LE(name.length, 26);
    const entry = Buffer.alloc(46);
    entry.writeUInt32LE(0x02014b50, 0);
    entry.writeUInt16LE(8, 10);
    entry.writeUInt32LE(packed.length, 20);
    entry.writeUInt16LE(name.length, 28);
    entry.writeUInt32LE(at, 42);
    parts.push(local, Buffer.from(name), packed);
    list.push(entry, Buffer.from(name));
    at += 30 + name.length + packed.length;
  }
  const end = Buffer.alloc(22);
  end.writeUInt32LE(0x06054b50, 0);
  end.writeUInt16LE(Object.keys(files).length, 10);
  end.writeUInt32LE(Buffer.concat(list).length, 12);
  end.writeUInt32LE(at, 16);
  return Buffer.concat([...parts, ...list, end]);
}

test("several files, an archive and the clipboard", async () => {
  const { page, complaints } = await visit(served);
  await untilReady(page);
  const shown = (name) => page.waitForSelector(`#objects [value='file:${name}']:checked`);
  await page.setInputFiles("#file", [file("one.obj", BOX), file("two.obj", BOX.replaceAll("120", "80"))]);
  await shown("one.obj");
  await page.click("#objects label:has-text('two.obj')");
  await shown("two.obj");
  await page.waitForFunction(() => document.getElementById("report-size").textContent === "4.0 × 6.0 × 8.0 cm");
  await page.setInputFiles("#file", file("four.gltf", gltf()));
  await shown("four.gltf");
  await page.waitForFunction(() => document.getElementById("report-size").textContent === "4.0 × 6.0 × 12.0 cm");
  const archive = zip({ "meshes/three.obj": BOX.replaceAll("120", "70"), "read me.txt": "no mesh", "__MACOSX/three.obj": "x" });
  await page.setInputFiles("#file", file("meshes.zip", archive));
  await shown("three.obj");
  await page.waitForFunction(() => document.getElementById("report-size").textContent === "4.0 × 6.0 × 7.0 cm");
  // The list of its files would lie behind its end.
  const short = Buffer.from(archive);
  short.writeUInt32LE(short.length, short.length - 6);
  for (const [name, bytes, cause] of [
    ["cut.zip", archive.subarray(0, 100), /no end/],
    ["short.zip", short, /a part of it is missing/],
    ["letters.zip", zip({ "letter.txt": "Dear reader" }), /holds no OBJ/],
    ["bomb.zip", zip({ "bomb.obj": Buffer.alloc(260e6) }), /larger than 250 MB/],
  ]) {
    await page.setInputFiles("#file", file(name, bytes));
    const card = await page.waitForSelector(`.failure:has-text("${name}")`);
    assert.match(await card.textContent(), cause);
  }
  await page.evaluate((text) => {
    const clipboardData = new DataTransfer();
    clipboardData.items.add(new File([text], "pasted.obj"));
    dispatchEvent(new ClipboardEvent("paste", { clipboardData }));
  }, BOX);
  await shown("pasted.obj");
  // What cannot be read goes from the list again.
  await page.setInputFiles("#file", file("bad.obj", "v 1"));
  await page.waitForSelector('.failure:has-text("bad.obj")');
  await shown("pasted.obj");
  assert.equal(await page.locator("#objects [value='file:bad.obj']").count(), 0);
  assert.deepEqual(complaints, []);
  await page.close();
});

test("a folder is dropped, and every format in it is read", async (t) => {
  const folder = mkdtempSync(join(tmpdir(), "meshes-"));
  t.after(() => rmSync(folder, { recursive: true }));
  mkdirSync(join(folder, "deeper"));
  const meshes = others();
  Object.entries(meshes).forEach(([name, bytes], k) => writeFileSync(join(folder, k % 2 ? "deeper" : ".", name), bytes));
  writeFileSync(join(folder, "notes.txt"), "no mesh");
  const { page, complaints } = await visit(served);
  await untilReady(page);
  const session = await page.context().newCDPSession(page);
  const data = { items: [], files: [folder], dragOperationsMask: 1 };
  for (const type of ["dragEnter", "dragOver"]) await session.send("Input.dispatchDragEvent", { type, x: 400, y: 300, data });
  await page.waitForSelector("#drop", { state: "visible" });
  await session.send("Input.dispatchDragEvent", { type: "drop", x: 400, y: 300, data });
  await page.waitForSelector("#drop", { state: "hidden" });
  // The same folder by its button changes nothing.
  const [chooser] = await Promise.all([page.waitForEvent("filechooser"), page.click("#upload-folder")]);
  await chooser.setFiles(folder);
  await page.waitForFunction(() => document.querySelectorAll("#objects [value^='file:']").length === 5);
  for (const name of Object.keys(meshes)) {
    await page.click("#objects label:has-text('Sugar box')");
    await page.waitForFunction(() => document.getElementById("report-size").textContent === "4.9 × 9.4 × 17.6 cm");
    await page.click(`#objects label:has-text('${name}')`);
    await page.waitForFunction(() => document.getElementById("report-size").textContent === "4.0 × 6.0 × 12.0 cm");
  }
  assert.equal(await page.locator("#objects [value^='file:']").count(), Object.keys(meshes).length);
  assert.deepEqual(complaints, []);
  await page.close();
});

test("of many files some are taken, and that is said", async () => {
  const { page } = await visit(served);
  await untilReady(page);
  await page.setInputFiles("#file", Array.from({ length: 51 }, (_, i) => file(`${i}.obj`, BOX)));
  await page.waitForSelector("[data-code=files_left_out]");
  assert.equal(await page.locator("#objects [value^='file:']").count(), 50);
  await page.close();
});

// A file on the disk: Playwright hands over no more than 50 MB in memory.
function stored(t, name, bytes) {
  const folder = mkdtempSync(join(tmpdir(), "meshes-"));
  t.after(() => rmSync(folder, { recursive: true }));
  writeFileSync(join(folder, name), bytes);
  return join(folder, name);
}

// A binary PLY file of six million triangles over a handful of vertices.
function large() {
  const head = `ply\nformat binary_little_endian 1.0\nelement vertex 4\nproperty uchar x\nproperty uchar y\nproperty uchar z
element face 6000000\nproperty list uchar uint vertex_indices\nend_header\n`;
  const vertices = Buffer.from([0, 0, 0, 9, 0, 0, 0, 9, 0, 0, 0, 9]);
  const face = Buffer.alloc(13);
  face.writeUInt8(3, 0);
  [0, 1, 2].forEach((index, corner) => face.writeUInt32LE(index, 1 + 4 * corner));
  return Buffer.concat([Buffer.from(head), vertices, Buffer.alloc(13 * 6_000_000, face)]);
}

// A box that stands on an edge, and would fall over.
const TILTED = BOX.replace("v 40 60 0", "v 40 60 90").replace("v 40 0 0", "v 40 0 90");
const LAID = "#report-notes li:has-text('it lies as it looks most like what the policy learned from')";

test("what would fall over lies as it looks most like what the policy learned", async () => {
  const { page, complaints } = await visit(served);
  await untilReady(page);
  await page.waitForFunction(() => /^Policy/.test(document.getElementById("model").textContent));
  await page.setInputFiles("#file", file("tilted.obj", TILTED));
  await page.waitForSelector(LAID);
  const laid = await page.textContent("#report-size");
  assert.notEqual(await page.inputValue("#sides"), "0");
  // Weighed anew it stays as it is; and a second worker, which has another policy or none, has it so, too.
  await page.fill("#mass", "300");
  await page.press("#mass", "Enter");
  await page.waitForFunction(() => document.getElementById("report-mass").textContent === "300 g");
  assert.equal(await page.textContent("#report-size"), laid);
  await page.click("#search");
  await page.waitForFunction(() => /lifts? it reliably/.test(document.getElementById("search-words").textContent));
  assert.equal(await page.locator("[data-code=grasps_of_another]").count(), 0);
  // Somebody may think otherwise, and has the last word.
  await page.selectOption("#sides", "0");
  await page.waitForFunction((laid) => document.getElementById("report-size").textContent !== laid, laid);
  // A second policy has the attempt that was asked for while it was read, too, with the object as it lies.
  await page.focus("#compare");
  await page.waitForSelector("#compare [value=default]", { state: "attached" });
  await page.selectOption("#compare", "default");
  await page.waitForFunction(() => document.getElementById("who-2").textContent === "default");
  await page.selectOption("#speed", "4");
  await page.evaluate(async (text) => {
    const input = document.getElementById("file");
    const files = new DataTransfer();
    // Long enough to be still on its way.
    files.items.add(new File([text, "# and so on\n".repeat(1e6)], "tilted.obj"));
    input.files = files.files;
    input.dispatchEvent(new Event("change"));
    await new Promise((resolve) => setTimeout(resolve, 1));
    document.getElementById("grasp").click();
  }, TILTED);
  await page.waitForFunction(() => ["who-1", "who-2"].every((who) => /^default: [A-Z]/.test(document.getElementById(who).textContent)));
  assert.equal(await page.textContent("#who-1"), await page.textContent("#who-2"));
  assert.deepEqual(complaints, []);
  await page.close();
});

test("what was brought before the policy came is laid when it has", async () => {
  const { page } = await blank(served);
  let letGo = () => {};
  const held = new Promise((resolve) => (letGo = resolve));
  await page.route("**/weights**", async (route) => {
    await held;
    await route.continue();
  });
  await page.goto(served.address);
  await page.waitForSelector("#upload:enabled");
  await page.setInputFiles("#file", file("tilted.obj", TILTED));
  await page.waitForSelector("#report-notes li:has-text('it lies on its steadiest side')");
  letGo();
  await page.waitForSelector(LAID);
  await page.close();
});

// A binary STL file of a ball (mm): rings of quadrilaterals, each of two triangles.
function ball(radius, rings) {
  const round = 2 * rings;
  const at = (ring, k) => {
    const [polar, turn] = [(Math.PI * ring) / rings, (Math.PI * (k % round)) / rings];
    return [Math.sin(polar) * Math.cos(turn), Math.sin(polar) * Math.sin(turn), Math.cos(polar)].map((x) => radius * x);
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

test("of too many triangles fewer are made, which is told", async (t) => {
  const { page, complaints } = await visit(served);
  await untilReady(page);
  const began = performance.now();
  await page.setInputFiles("#file", stored(t, "ball.stl", ball(35, 600)));
  await page.waitForFunction(() => document.getElementById("report-size").textContent === "7.0 × 7.0 × 7.0 cm");
  t.diagnostic(`${((performance.now() - began) / 1000).toFixed(1)} s from a file of 1,440,000 triangles to an object`);
  assert.match(await page.textContent("#report-notes"), /Its 1440000 triangles were made fewer, which moved none by more than 0\.[1-4] mm/);
  await page.selectOption("#speed", "4");
  await page.click("#grasp");
  await page.waitForSelector("[data-phase=verdict].is-now");
  assert.deepEqual(complaints, []);
  await page.close();
});

test("bad files each say what is wrong, and the scene goes on", async (t) => {
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
    ["large.ply", large(), /at most 5000000/],
  ]) {
    await page.setInputFiles("#file", name === "large.ply" ? stored(t, name, text) : file(name, text));
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

test("a mesh that takes long to read is given up, and the scene goes on", async () => {
  const { page, complaints } = await visit(served);
  await untilReady(page);
  const size = await page.textContent("#report-size");
  await page.selectOption("#compare", "default");
  await page.setInputFiles("#file", file("long.obj", bottle(400_000)));
  // What it is at is told.
  await page.waitForFunction(() => /^(Looking how|Cutting) long\.obj /.test(document.getElementById("progress-label").textContent));
  await page.click("#progress-stop");
  await untilReady(page);
  assert.ok(await page.isHidden("#progress"));
  assert.equal(await page.textContent("#report-size"), size);
  assert.ok(await page.isChecked("#objects [value=sugar_box]"));
  assert.equal(await page.locator("#objects [value='file:long.obj']").count(), 0);
  // What is brought next is read.
  await page.setInputFiles("#file", file("box.obj", BOX));
  await page.waitForFunction(() => document.getElementById("report-size").textContent === "4.0 × 6.0 × 12.0 cm");
  assert.deepEqual(complaints, []);
  await page.close();
});

test("a file that cannot be read leaves the one of its name, and one that can takes its place", async () => {
  const { page, complaints } = await visit(served);
  await untilReady(page);
  const brought = "#objects [value='file:box.obj']";
  const height = (cm) => page.waitForFunction((cm) => document.getElementById("report-size").textContent === `4.0 × 6.0 × ${cm} cm`, cm);
  const again = async (cm) => {
    await page.click("#objects label:has-text('Sugar box')");
    await page.waitForFunction(() => document.getElementById("report-size").textContent === "4.9 × 9.4 × 17.6 cm");
    await page.click("#objects label:has-text('box.obj')");
    await height(cm);
  };
  await page.setInputFiles("#file", file("box.obj", BOX));
  await height("12.0");
  await page.setInputFiles("#file", file("box.obj", "v 1"));
  await page.waitForSelector('.failure:has-text("box.obj")');
  await page.click(".failure .close");
  await page.waitForSelector(`${brought}:checked`);
  assert.equal(await page.locator(brought).count(), 1);
  await again("12.0");
  await page.reload();
  await untilReady(page);
  await again("12.0");
  await page.setInputFiles("#file", file("box.obj", BOX.replaceAll("120", "80")));
  await height("8.0");
  assert.equal(await page.locator(brought).count(), 1);
  await untilKept(page, "box.obj", (kept) => kept?.text.includes("80"));
  await page.reload();
  await untilReady(page);
  await again("8.0");
  // Two of one name are two.
  await page.setInputFiles("#file", file("parts.zip", zip({ "a/part.obj": BOX, "b/part.obj": BOX.replaceAll("120", "70") })));
  await height("12.0");
  await page.click("#objects label:has-text('part (2).obj')");
  await height("7.0");
  assert.deepEqual(complaints, []);
  await page.close();
});

test("what was said of a mesh holds on the next visit", async () => {
  const { page, complaints } = await visit(served);
  await untilReady(page);
  await bringOf250Grams(page);
  await page.selectOption("#sides", "0");
  await page.waitForFunction(() => document.getElementById("report-size").textContent.endsWith("× 4.0 cm"));
  await untilKept(page, "box.obj", (kept) => kept?.told?.stands?.on === 0);
  await page.reload();
  await untilReady(page);
  await page.click("#objects label:has-text('box.obj')");
  await page.waitForFunction(() => document.getElementById("report-size").textContent.endsWith("× 4.0 cm"));
  assert.equal(await page.textContent("#report-mass"), "250 g");
  assert.deepEqual(complaints, []);
  await page.close();
});

test("a mesh for which the browser has no room is there until the page is left, and that is told", async () => {
  const { page, complaints } = await blank(served);
  await page.addInitScript(() => {
    IDBObjectStore.prototype.put = () => {
      throw new DOMException("no room", "QuotaExceededError");
    };
  });
  await page.goto(served.address);
  await untilReady(page);
  await page.setInputFiles("#file", file("box.obj", BOX));
  assert.match(await page.textContent("[data-code=mesh_not_kept]"), /no room to keep box\.obj/);
  await page.waitForSelector("#objects label:has-text('box.obj') :checked");
  assert.equal(await page.textContent("#report-size"), "4.0 × 6.0 × 12.0 cm");
  await page.reload();
  await untilReady(page);
  assert.equal(await page.locator("#objects label:has-text('box.obj')").count(), 0);
  assert.deepEqual(complaints, []);
  await page.close();
});

test("a link about another file leaves what was said of one's own", async () => {
  const { page, complaints } = await visit(served);
  await untilReady(page);
  await bringOf250Grams(page);
  await untilKept(page, "box.obj", (kept) => kept?.told?.massKg === 0.25);
  const link = (unit) => `#v=1&o=other.stl&oh=0&u=${unit}&kg=0.7&p=0.6,0,0&s=0&m=default&sc=0&h=0`;
  await page.goto("about:blank");
  await page.goto(served.address + link("m"));
  await page.waitForSelector("[data-code=link_needs_file]");
  await untilReady(page);
  await page.click("#objects label:has-text('box.obj')");
  await page.waitForFunction(() => document.getElementById("report-size").textContent === "4.0 × 6.0 × 12.0 cm");
  assert.equal(await page.textContent("#report-mass"), "250 g");
  await untilKept(page, "box.obj", (kept) => kept?.told?.massKg === 0.25);
  // What no page writes is refused as a whole.
  await page.goto("about:blank");
  await page.goto(served.address + link("ell"));
  assert.match(await page.textContent("[data-code=link_damaged]"), /"u" says "ell"/);
  assert.deepEqual(complaints, []);
  await page.close();
});

test("two corrections that come at once both count", async () => {
  const { page, complaints } = await visit(served);
  await untilReady(page);
  await page.setInputFiles("#file", file("box.obj", BOX));
  await page.waitForFunction(() => document.getElementById("report-mass").textContent === "173 g");
  await page.evaluate(() => {
    const set = (id, value) => {
      const field = document.getElementById(id);
      field.value = value;
      field.dispatchEvent(new Event("change", { bubbles: true }));
    };
    set("mass", "250");
    set("sides", "0");
  });
  await page.waitForFunction(() => document.getElementById("report-size").textContent.endsWith("× 4.0 cm"));
  assert.equal(await page.textContent("#report-mass"), "250 g");
  assert.deepEqual(complaints, []);
  await page.close();
});

test("a mesh is there on the next visit, until it is removed", async () => {
  const { page, complaints } = await visit(served);
  await untilReady(page);
  const brought = "#objects [value='file:box.obj']";
  await page.setInputFiles("#file", [file("box.obj", BOX), file("bad.obj", "v 1")]);
  await page.waitForSelector(`${brought}:checked`);
  await page.click("#objects label:has-text('bad.obj')");
  await page.waitForSelector('.failure:has-text("bad.obj")');
  await untilKept(page, "box.obj", (kept) => kept);
  await untilKept(page, "bad.obj", (kept) => !kept);
  await page.reload();
  await untilReady(page);
  await page.waitForSelector(brought, { state: "attached" });
  assert.equal(await page.locator("#objects [value='file:bad.obj']").count(), 0, "what cannot be read is not kept");
  assert.ok(await page.isHidden("#remove"), "it does not stand there yet");
  await page.click("#objects label:has-text('box.obj')");
  await page.waitForFunction(() => document.getElementById("report-size").textContent === "4.0 × 6.0 × 12.0 cm");
  await screenshot(page, "upload-kept");
  await page.click("#remove");
  await page.waitForFunction(() => document.getElementById("report-size").textContent !== "4.0 × 6.0 × 12.0 cm");
  assert.equal(await page.locator(brought).count(), 0);
  assert.ok(await page.isHidden("#remove"));
  await untilKept(page, "box.obj", (kept) => !kept);
  await page.reload();
  await untilReady(page);
  await page.waitForTimeout(500);
  assert.equal(await page.locator(brought).count(), 0);
  assert.deepEqual(complaints, []);
  await page.close();
});
