// What comes broken, late or too long: the page says so, goes on, and keeps what stands on the table.

import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { blank, open, PATIENCE, restart, untilReady, visit } from "./chromium.js";
import { BOX } from "./meshes.js";

let served;
before(async () => (served = await open()));
after(() => served?.close());

// The demo with its weights answered otherwise.
async function withWeights(answer) {
  const { page } = await blank(served);
  await page.route("**/weights**", answer);
  await page.goto(served.address);
  return page;
}

// Whoever else can act does.
async function graspsAllTheSame(page) {
  await untilReady(page);
  assert.match(await page.textContent("#model"), /planner/);
  assert.ok(await page.isChecked("input[value=sugar_box]"));
  await page.click("#grasp");
  await page.waitForSelector("#phases li.is-now[data-phase=policy]");
  await page.close();
}

test("weights that are damaged are named, and the planner acts", async () => {
  const page = await withWeights(async (route) => {
    const good = await route.fetch();
    const body = await good.body();
    body.fill(0xab, 1000);
    await route.fulfill({ response: good, body });
  });
  await page.waitForSelector('[data-code="model_unusable"]');
  await graspsAllTheSame(page);
});

test("weights that never come are given up, and the planner acts", async () => {
  const page = await withWeights(() => {});
  await page.waitForSelector('[data-code="model_not_fetched"]', { timeout: PATIENCE });
  assert.match(await page.textContent('[data-code="model_not_fetched"]'), /nothing has come for 20 s/);
  await graspsAllTheSame(page);
});

test("what stands on the table is what was read: a search and a restart are about that", async () => {
  const { page } = await visit(served);
  await untilReady(page);
  const obj = (name, text) => ({ name, mimeType: "model/obj", buffer: Buffer.from(text) });
  await page.click("#objects label:has([value=mustard])");
  await page.waitForFunction(() => document.getElementById("report-mass").textContent === "603 g");
  await page.fill("#seed", "3");
  await page.press("#seed", "Enter");
  await page.setInputFiles("#file", obj("bad.obj", "v 1"));
  await page.waitForSelector('.failure:has-text("bad.obj")');
  await page.click(".failure .close");
  // A search that had been given the refused file would refuse it again.
  await page.click("#search");
  await page.waitForSelector("#search-bar[value]");
  await page.click("#search");
  await restart(page);
  assert.equal(await page.textContent("#report-mass"), "603 g");
  assert.ok(await page.isChecked("[value=mustard]"));
  assert.equal(await page.locator(".failure").count(), 0);
  await page.selectOption("#speed", "4");
  await page.click("#grasp");
  await page.waitForSelector("[data-phase=verdict].is-now");
  assert.match(await page.textContent("#hash"), /^Seed 3 ended/, "its pose is still the seed's");
  // Of a file that was read, the page keeps the bytes, however often.
  await page.setInputFiles("#file", obj("box.obj", BOX));
  await page.waitForSelector("#objects [value='file:box.obj']:checked");
  for (let times = 0; times < 2; times++) {
    await restart(page);
    assert.equal(await page.textContent("#report-size"), "4.0 × 6.0 × 12.0 cm");
    assert.ok(await page.isChecked("#objects [value='file:box.obj']"));
  }
  await page.close();
});

test("a panic in the simulation is told with its reason, and what stands on the table stays", async () => {
  const { page } = await visit(served);
  await untilReady(page);
  await page.setInputFiles("#file", { name: "box.obj", mimeType: "model/obj", buffer: Buffer.from(BOX) });
  await page.waitForFunction(() => document.getElementById("report-size").textContent === "4.0 × 6.0 × 12.0 cm");
  await page.workers()[0].evaluate(() => {
    setTimeout(() => self.onmessage(new MessageEvent("message", { data: { kind: "panic" } })));
  });
  const card = await page.waitForSelector('[data-code="engine_panicked"]');
  assert.match(await card.textContent(), /worker\.rs:\d+.*the page asked for it/s);
  assert.equal(await page.locator(".failure").count(), 1, "it is told once");
  assert.ok((await page.isDisabled("#grasp")) && (await page.isDisabled("#upload")));
  assert.ok(await page.isHidden(".failure .close"), "nothing else offers to restart");
  await page.click(".failure .again");
  await untilReady(page);
  assert.equal(await page.textContent("#report-size"), "4.0 × 6.0 × 12.0 cm");
  await page.close();
});

test("a page of which a part does not come says so", async () => {
  const { page } = await blank(served);
  await page.route(/\/main-[^/]*\.js$/, (route) => route.fulfill({ status: 404 }));
  await page.goto(served.address);
  await page.waitForSelector("#broken:not([hidden])");
  assert.match(await page.textContent("#broken"), /Reload it/);
  assert.ok(await page.isHidden("#headline"));
  await page.close();
});

test("what nobody has foreseen is told", async () => {
  const { page } = await visit(served);
  await page.evaluate(() => {
    setTimeout(() => {
      throw new Error("forgotten by us");
    });
  });
  const card = page.locator('[data-code="page_failed"]');
  await card.waitFor();
  assert.match(await card.textContent(), /forgotten by us/);
  // A page that came over plain http from another machine has no clipboard.
  await page.evaluate(() => Object.defineProperty(navigator, "clipboard", { value: undefined }));
  await card.locator(".copy").click();
  await page.waitForFunction(() => String(getSelection()).includes("forgotten by us"));
  await page.close();
});

test("a file without end is not read", async () => {
  const { page } = await visit(served);
  await untilReady(page);
  await page.evaluate(() => {
    // A name and a size; the bytes are nobody's.
    const file = new File([], "statue.obj");
    Object.defineProperty(file, "size", { value: 4e12 });
    const data = new DataTransfer();
    data.items.add(new File([], "x.obj"));
    Object.defineProperty(data, "files", { value: [file] });
    const paste = new Event("paste");
    Object.defineProperty(paste, "clipboardData", { value: data });
    dispatchEvent(paste);
  });
  await page.waitForSelector('[data-code="mesh_too_large"]');
  assert.ok(await page.isChecked("input[value=sugar_box]"));
  await page.close();
});

test("by keyboard alone a mesh is brought, grasped and shared", async () => {
  const { page } = await visit(served);
  await untilReady(page);
  const tabTo = async (id) => {
    for (let presses = 0; presses < 100; presses++) {
      if ((await page.evaluate(() => document.activeElement.id)) === id) return;
      await page.keyboard.press("Tab");
    }
    throw new Error(`Tab does not lead to ${id}`);
  };
  // Early: from the first listener on the browser hands over what it would show, and takes its time to begin with it.
  const chooser = page.waitForEvent("filechooser");
  await tabTo("upload");
  await page.keyboard.press("Enter");
  await (await chooser).setFiles({ name: "box.obj", mimeType: "model/obj", buffer: Buffer.from(BOX) });
  await page.waitForFunction(() => document.getElementById("report-size").textContent.startsWith("4.0"));
  await tabTo("grasp");
  await page.keyboard.press("Enter");
  await page.waitForSelector("#phases li.is-now[data-phase=verdict]");
  assert.notEqual(await page.textContent("#announcement"), "");
  await tabTo("copy-link");
  await page.keyboard.press("Enter");
  await page.waitForFunction(() => /Copied|#/.test(document.getElementById("share-hint").textContent));
  await page.close();
});
