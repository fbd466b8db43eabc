// Corrupt, late and oversized input: the page reports it, stays usable, and keeps the object.

import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { newPage, open, TIMEOUT_MS, restart, untilReady, visit } from "./chromium.js";
import { BOX } from "./meshes.js";

let served;
before(async () => (served = await open()));
after(() => served?.close());

// Opens the demo with another handler for the weights.
async function openWithWeights(handler) {
  const { page } = await newPage(served);
  await page.route("**/weights**", handler);
  await page.goto(served.address);
  return page;
}

// Checks that an attempt falls back to the planner.
async function expectPlannerFallback(page) {
  await untilReady(page);
  assert.match(await page.textContent("#model"), /planner/);
  assert.ok(await page.isChecked("input[value=sugar_box]"));
  await page.click("#grasp");
  await page.waitForSelector("#phases li.is-now[data-phase=policy]");
  await page.close();
}

test("corrupt weights are reported, and the planner is used", async () => {
  const page = await openWithWeights(async (route) => {
    const good = await route.fetch();
    const body = await good.body();
    body.fill(0xab, 1000);
    await route.fulfill({ response: good, body });
  });
  await page.waitForSelector('[data-code="invalid_model"]');
  await expectPlannerFallback(page);
});

test("download of weights times out, and the planner is used", async () => {
  const page = await openWithWeights(() => {});
  await page.waitForSelector('[data-code="model_download_failed"]', { timeout: TIMEOUT_MS });
  assert.match(await page.textContent('[data-code="model_download_failed"]'), /no data received for 20 s/);
  await expectPlannerFallback(page);
});

test("search and restart use the object on the table, not a rejected file", async () => {
  const { page } = await visit(served);
  await untilReady(page);
  const obj = (name, text) => ({ name, mimeType: "model/obj", buffer: Buffer.from(text) });
  await page.click("#objects label:has([value=mustard])");
  await page.waitForFunction(() => document.getElementById("info-mass").textContent === "603 g");
  await page.fill("#seed", "3");
  await page.press("#seed", "Enter");
  await page.setInputFiles("#file", obj("bad.obj", "v 1"));
  await page.waitForSelector('.failure:has-text("bad.obj")');
  await page.click(".failure .close");
  // A search of the rejected file would report it again.
  await page.click("#search");
  await page.waitForSelector("#search-bar[value]");
  await page.click("#search");
  await restart(page);
  assert.equal(await page.textContent("#info-mass"), "603 g");
  assert.ok(await page.isChecked("[value=mustard]"));
  assert.equal(await page.locator(".failure").count(), 0);
  await page.selectOption("#speed", "4");
  await page.click("#grasp");
  await page.waitForSelector("[data-phase=outcome].is-now");
  assert.match(await page.textContent("#hash"), /^Seed 3\. Final state/, "the pose is still that of the seed");
  // The page keeps the bytes of an imported file for repeated restarts.
  await page.setInputFiles("#file", obj("box.obj", BOX));
  await page.waitForSelector("#objects [value='file:box.obj']:checked");
  for (let times = 0; times < 2; times++) {
    await restart(page);
    assert.equal(await page.textContent("#info-size"), "4.0 × 6.0 × 12.0 cm");
    assert.ok(await page.isChecked("#objects [value='file:box.obj']"));
  }
  await page.close();
});

test("panic in the worker is reported with its reason, and the object is kept", async () => {
  const { page } = await visit(served);
  await untilReady(page);
  await page.setInputFiles("#file", { name: "box.obj", mimeType: "model/obj", buffer: Buffer.from(BOX) });
  await page.waitForFunction(() => document.getElementById("info-size").textContent === "4.0 × 6.0 × 12.0 cm");
  await page.workers()[0].evaluate(() => {
    setTimeout(() => self.onmessage(new MessageEvent("message", { data: { kind: "panic" } })));
  });
  const card = await page.waitForSelector('[data-code="worker_panicked"]');
  assert.match(await card.textContent(), /worker\.rs:\d+.*requested by the page/s);
  assert.equal(await page.locator(".failure").count(), 1, "the panic is reported once");
  assert.ok((await page.isDisabled("#grasp")) && (await page.isDisabled("#upload")));
  assert.ok(await page.isHidden(".failure .close"), "a panic card cannot be closed");
  await page.click(".failure .retry");
  await untilReady(page);
  assert.equal(await page.textContent("#info-size"), "4.0 × 6.0 × 12.0 cm");
  await page.close();
});

test("page with a missing script shows a message", async () => {
  const { page } = await newPage(served);
  await page.route(/\/app-[^/]*\.js$/, (route) => route.fulfill({ status: 404 }));
  await page.goto(served.address);
  await page.waitForSelector("#broken:not([hidden])");
  assert.match(await page.textContent("#broken"), /Reload it/);
  assert.ok(await page.isHidden("#headline"));
  await page.close();
});

test("missing mesh reader is reported, and the file can be selected again", async () => {
  const { page } = await visit(served);
  await untilReady(page);
  await page.route("**/mesh_reader_bg*", (route) => route.abort());
  await page.setInputFiles("#file", { name: "box.obj", mimeType: "model/obj", buffer: Buffer.from(BOX) });
  const card = page.locator('[data-code="mesh_reader_failed"]');
  await card.waitFor();
  assert.match(await card.textContent(), /box\.obj could not be read.*select the file again/s);
  assert.ok(await page.isChecked("input[value=sugar_box]"));
  await page.unroute("**/mesh_reader_bg*");
  await page.click('#objects label:has-text("box.obj")');
  await page.waitForFunction(() => document.getElementById("info-size").textContent.includes("12.0"));
  await page.close();
});

test("unexpected error of the page is reported", async () => {
  const { page } = await visit(served);
  await page.evaluate(() => {
    setTimeout(() => {
      throw new Error("unexpected test error");
    });
  });
  const card = page.locator('[data-code="page_error"]');
  await card.waitFor();
  assert.match(await card.textContent(), /unexpected test error/);
  // A page served by plain HTTP from another machine has no clipboard.
  await page.evaluate(() => Object.defineProperty(navigator, "clipboard", { value: undefined }));
  await card.locator(".copy").click();
  await page.waitForFunction(() => String(getSelection()).includes("unexpected test error"));
  await page.close();
});

test("oversized file is rejected before it is read", async () => {
  const { page } = await visit(served);
  await untilReady(page);
  await page.evaluate(() => {
    // A file object with a large size and no content.
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

test("mesh can be uploaded, grasped and shared by keyboard alone", async () => {
  const { page } = await visit(served);
  await untilReady(page);
  const tabTo = async (id) => {
    for (let presses = 0; presses < 100; presses++) {
      if ((await page.evaluate(() => document.activeElement.id)) === id) return;
      await page.keyboard.press("Tab");
    }
    throw new Error(`Tab does not reach ${id}`);
  };
  // Listen early: Playwright needs time to start intercepting file choosers.
  const chooser = page.waitForEvent("filechooser");
  await tabTo("upload");
  await page.keyboard.press("Enter");
  await (await chooser).setFiles({ name: "box.obj", mimeType: "model/obj", buffer: Buffer.from(BOX) });
  await page.waitForFunction(() => document.getElementById("info-size").textContent.startsWith("4.0"));
  await tabTo("grasp");
  await page.keyboard.press("Enter");
  await page.waitForSelector("#phases li.is-now[data-phase=outcome]");
  assert.notEqual(await page.textContent("#announcement"), "");
  await tabTo("copy-link");
  await page.keyboard.press("Enter");
  await page.waitForFunction(() => /Copied|#/.test(document.getElementById("share-hint").textContent));
  await page.close();
});
