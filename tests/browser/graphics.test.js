// Graphics that are taken away, and none at all.

import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { blank, findObject, grasp, open, screenshot, untilReady, visit } from "./chromium.js";

let served;
before(async () => (served = await open()));
after(() => served?.close());

test("graphics that are taken away come back", async () => {
  const { page } = await visit(served);
  await page.evaluate(() => {
    const context = document.getElementById("view").getContext("webgl2");
    globalThis.loss = context.getExtension("WEBGL_lose_context");
    globalThis.loss.loseContext();
  });
  await page.waitForSelector('[data-code="graphics_lost"]');
  await page.evaluate(() => globalThis.loss.restoreContext());
  await page.waitForSelector('[data-code="graphics_lost"]', { state: "detached" });
  await page.close();
});

// Runs in the page: how many colours a grid of the picture's points has.
function colors() {
  const canvas = document.getElementById("view");
  const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
  const found = new Set();
  for (let i = 0; i < data.length; i += 4 * 97) found.add(`${data[i]} ${data[i + 1]} ${data[i + 2]}`);
  return found.size;
}

test("without WebGL a sketch is drawn, in which the object is dragged and grasped", async (t) => {
  const flat = await open({ args: ["--disable-3d-apis"] });
  t.after(() => flat.close());
  const { page, complaints } = await blank(flat);
  await page.goto(flat.address);
  assert.match(await page.textContent("[data-code=graphics_flat]"), /flat sketch/);
  await page.waitForFunction(() => Number(document.getElementById("view").dataset.drawn) > 0);
  await untilReady(page);
  await page.click("[data-code=graphics_flat] .close");
  await page.waitForFunction(`(${colors})() > 12`);
  const [x, y] = await page.evaluate(findObject);
  const before = await page.inputValue("#pose-y");
  await page.mouse.move(x, y);
  await page.mouse.down();
  await page.mouse.move(x + 60, y, { steps: 8 });
  await page.mouse.up();
  await page.waitForFunction((y) => document.getElementById("pose-y").value !== y, before);
  await screenshot(page, "sketch");
  assert.equal((await grasp(page, 0)).words, "Lifted and held.");
  await screenshot(page, "sketch-held");
  // What three.js says of it goes to the console.
  assert.deepEqual(complaints.filter((words) => !words.includes("THREE.WebGLRenderer")), []);
  await page.close();
});

test("where nothing can be drawn verdicts are told all the same", async () => {
  const { page } = await blank(served);
  await page.addInitScript(() => (HTMLCanvasElement.prototype.getContext = () => null));
  await page.goto(served.address);
  await page.waitForSelector("[data-code=graphics_missing]");
  await untilReady(page);
  assert.equal((await grasp(page, 0)).words, "Lifted and held.");
  // What cannot be done without a picture does no harm.
  await page.click("#save-png");
  await page.keyboard.press("c");
  assert.ok(await page.isEnabled("#grasp"));
  await page.close();
});
