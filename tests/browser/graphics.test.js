// Lost graphics context, 2D fallback, and no graphics.

import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { newPage, findObject, grasp, open, screenshot, untilReady, visit } from "./chromium.js";

let served;
before(async () => (served = await open()));
after(() => served?.close());

test("lost graphics context is restored", async () => {
  const { page } = await visit(served);
  await page.evaluate(() => {
    const context = document.getElementById("view").getContext("webgl2");
    globalThis.extension = context.getExtension("WEBGL_lose_context");
    globalThis.extension.loseContext();
  });
  await page.waitForSelector('[data-code="graphics_lost"]');
  await page.evaluate(() => globalThis.extension.restoreContext());
  await page.waitForSelector('[data-code="graphics_lost"]', { state: "detached" });
  await page.close();
});

// Runs in the page: number of colors in a sample of the canvas.
function colors() {
  const canvas = document.getElementById("view");
  const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
  const found = new Set();
  for (let i = 0; i < data.length; i += 4 * 97) found.add(`${data[i]} ${data[i + 1]} ${data[i + 2]}`);
  return found.size;
}

test("2D canvas fallback without WebGL allows dragging and grasping", async (t) => {
  const withoutWebgl = await open({ args: ["--disable-3d-apis"] });
  t.after(() => withoutWebgl.close());
  const { page, errors } = await newPage(withoutWebgl);
  await page.goto(withoutWebgl.address);
  assert.match(await page.textContent("[data-code=webgl_unavailable]"), /a 2D canvas is used/);
  await page.waitForFunction(() => Number(document.getElementById("view").dataset.drawn) > 0);
  await untilReady(page);
  await page.click("[data-code=webgl_unavailable] .close");
  await page.waitForFunction(`(${colors})() > 12`);
  const [x, y] = await page.evaluate(findObject);
  const before = await page.inputValue("#pose-y");
  await page.mouse.move(x, y);
  await page.mouse.down();
  await page.mouse.move(x + 60, y, { steps: 8 });
  await page.mouse.up();
  await page.waitForFunction((y) => document.getElementById("pose-y").value !== y, before);
  await screenshot(page, "canvas-2d");
  assert.equal((await grasp(page, 0)).headline, "Lifted and held.");
  await screenshot(page, "canvas-2d-held");
  // three.js logs the missing WebGL to the console.
  assert.deepEqual(errors.filter((text) => !text.includes("THREE.WebGLRenderer")), []);
  await page.close();
});

test("outcome is shown without any graphics", async () => {
  const { page } = await newPage(served);
  await page.addInitScript(() => (HTMLCanvasElement.prototype.getContext = () => null));
  await page.goto(served.address);
  await page.waitForSelector("[data-code=graphics_unavailable]");
  await untilReady(page);
  assert.equal((await grasp(page, 0)).headline, "Lifted and held.");
  // Actions that need the canvas have no effect.
  await page.click("#save-png");
  await page.keyboard.press("c");
  assert.ok(await page.isEnabled("#grasp"));
  await page.close();
});
