// What an onlooker can see of an attempt and do to it: layers, and pulling at the object.

import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { findObject, open, screenshot, untilReady, visit } from "./chromium.js";

let served;
before(async () => (served = await open()));
after(() => served?.close());

const phase = (page, name) => page.waitForSelector(`#phases li.is-now[data-phase="${name}"]`);

// Begins an attempt, and lets time go slowly once the policy acts: nothing is over before a busy machine has seen it.
async function graspSlowly(page) {
  await page.click("#grasp");
  await phase(page, "policy");
  await page.selectOption("#speed", "0.25");
}

// Takes hold of the object and draws to the side.
async function pull(page) {
  const [x, y] = await page.evaluate(findObject);
  await page.mouse.move(x, y);
  await page.mouse.down();
  await page.mouse.move(x + 40, y - 10, { steps: 4 });
  await page.mouse.move(x + 120, y - 30, { steps: 4 });
}

test("forces and what the encoder makes of the cloud are drawn", async () => {
  const { page, complaints } = await visit(served);
  await untilReady(page);
  for (const layer of ["reconstruction", "forces"]) await page.locator(`#layer-${layer}`).check({ force: true });
  await graspSlowly(page);
  await screenshot(page, "reconstruction");
  await phase(page, "hold");
  await screenshot(page, "forces");
  assert.deepEqual(complaints, []);
  await page.close();
});

test("where the commands would have the hand is drawn, and how like what was learned the object looks is told", async () => {
  const { page, complaints } = await visit(served);
  await untilReady(page);
  assert.ok(await page.isHidden("#report-likeness"));
  await page.keyboard.press("j");
  assert.ok(await page.isChecked("#layer-target"));
  await graspSlowly(page);
  await phase(page, "hold");
  assert.match(await page.textContent("#report-likeness"), /^like what it learned from, most like the sugar box, [012]\.\d apart in z: the encoder is off by [345]\.\d mm$/);
  await screenshot(page, "target");
  // The thumb is turned as far as it goes: that is seen through what stands before it.
  await page.click("#pause");
  await page.keyboard.press("j");
  const pictures = [];
  for (const key of ["", "k", "k"]) {
    if (key) await page.keyboard.press(key);
    await page.waitForTimeout(700);
    pictures.push((await page.locator("#view").screenshot()).toString("base64"));
    if (pictures.length === 2) await screenshot(page, "limits");
  }
  assert.deepEqual([pictures[0] === pictures[1], pictures[0] === pictures[2]], [false, true]);
  assert.deepEqual(complaints, []);
  await page.close();
});

test("an attempt at which somebody pulls does not count", async () => {
  const { page, complaints } = await visit(served);
  await untilReady(page);
  await graspSlowly(page);
  await phase(page, "lift");
  await pull(page);
  await screenshot(page, "pull");
  // It goes on from where it is.
  const [tick, ticks] = await page.evaluate(() => {
    const { value, max } = document.getElementById("timeline");
    return [Number(value), Number(max)];
  });
  assert.ok(tick > 0 && tick > ticks - 10, `${tick} of ${ticks}`);
  await page.waitForFunction(() => document.getElementById("hash").textContent.startsWith("Somebody pulled"));
  await page.mouse.up();
  assert.match(await page.textContent("#tally"), /^None yet/);
  assert.ok(await page.isDisabled("#copy-link"));
  assert.match(await page.textContent("#share-hint"), /how somebody pulled/);
  assert.deepEqual(complaints, []);
  await page.close();
});

test("what is held can be pulled at afterwards, and the verdict stays", async () => {
  const { page, complaints } = await visit(served);
  await untilReady(page);
  await page.click("#grasp");
  await phase(page, "verdict");
  const told = await page.textContent("#hash");
  const ticks = () => page.evaluate(() => Number(document.getElementById("timeline").max));
  const before = await ticks();
  await page.keyboard.down("Control");
  await pull(page);
  await page.waitForFunction((before) => Number(document.getElementById("timeline").max) > before + 10, before);
  await page.mouse.up();
  await page.keyboard.up("Control");
  // What is let go does not hang in the air: the world goes on for a while, and no longer.
  const released = await ticks();
  await page.waitForFunction((released) => Number(document.getElementById("timeline").max) > released + 20, released);
  await page.waitForTimeout(4000);
  const settled = await ticks();
  await page.waitForTimeout(500);
  assert.equal(await ticks(), settled);
  assert.equal(await page.textContent("#hash"), told);
  assert.ok(await page.isEnabled("#copy-link"));
  assert.deepEqual(complaints, []);
  await page.close();
});
