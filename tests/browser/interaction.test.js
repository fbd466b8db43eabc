// Inspection and interaction: layers, and dragging the object during an attempt.

import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { findObject, open, screenshot, untilReady, visit } from "./chromium.js";
import { BOX } from "./meshes.js";

let served;
before(async () => (served = await open()));
after(() => served?.close());

const phase = (page, name) => page.waitForSelector(`#phases li.is-now[data-phase="${name}"]`);

// Starts an attempt and reduces the speed in the policy phase, so that a slow machine renders every phase.
async function graspSlowly(page) {
  await page.click("#grasp");
  await phase(page, "policy");
  await page.selectOption("#speed", "0.25");
}

// Grabs the object and drags it sideways.
async function drag(page) {
  const [x, y] = await page.evaluate(findObject);
  await page.mouse.move(x, y);
  await page.mouse.down();
  await page.mouse.move(x + 40, y - 10, { steps: 4 });
  await page.mouse.move(x + 120, y - 30, { steps: 4 });
}

test("contact forces and reconstruction are rendered", async () => {
  const { page, errors } = await visit(served);
  await untilReady(page);
  for (const layer of ["reconstruction", "forces"]) await page.locator(`#layer-${layer}`).check({ force: true });
  await graspSlowly(page);
  await screenshot(page, "reconstruction");
  await phase(page, "hold");
  await screenshot(page, "forces");
  assert.deepEqual(errors, []);
  await page.close();
});

test("commanded pose is rendered and familiarity is shown", async () => {
  const { page, errors } = await visit(served);
  await untilReady(page);
  assert.ok(await page.isHidden("#info-familiarity"));
  await page.keyboard.press("j");
  assert.ok(await page.isChecked("#layer-target"));
  await graspSlowly(page);
  await phase(page, "hold");
  assert.match(await page.textContent("#info-familiarity"), /^similar to training objects \(closest: sugar box, latent distance [012]\.\d\)\. Reconstruction error: [345]\.\d mm$/);
  await screenshot(page, "target");
  // The thumb is at its joint limit; the highlight is visible through other bodies.
  await page.click("#pause");
  await page.keyboard.press("j");
  const images = [];
  for (const key of ["", "k", "k"]) {
    if (key) await page.keyboard.press(key);
    await page.waitForTimeout(700);
    images.push((await page.locator("#view").screenshot()).toString("base64"));
    if (images.length === 2) await screenshot(page, "limits");
  }
  assert.deepEqual([images[0] === images[1], images[0] === images[2]], [false, true]);
  assert.deepEqual(errors, []);
  await page.close();
});

test("attempt with user interaction is not counted", async () => {
  const { page, errors } = await visit(served);
  await untilReady(page);
  await graspSlowly(page);
  await phase(page, "lift");
  await drag(page);
  await screenshot(page, "drag");
  // The attempt continues from its current state.
  const [tick, ticks] = await page.evaluate(() => {
    const { value, max } = document.getElementById("timeline");
    return [Number(value), Number(max)];
  });
  assert.ok(tick > 0 && tick > ticks - 10, `${tick} of ${ticks}`);
  await page.waitForFunction(() => document.getElementById("hash").textContent.startsWith("You moved the object"));
  await page.mouse.up();
  // The fingers may still touch the object.
  const [contacts] = (await page.textContent("#evidence")).split(/[.(]/);
  const isInHand = /finger|palm/.test(contacts);
  const headline = isInHand ? "You moved the object: not counted." : "You pulled the object out of the hand: not counted.";
  assert.equal(await page.textContent("#headline"), headline, contacts);
  assert.match(await page.textContent("#tally"), /^No attempts/);
  assert.ok(await page.isDisabled("#copy-link"));
  assert.match(await page.textContent("#share-hint"), /your interaction with the object/);
  assert.deepEqual(errors, []);
  await page.close();
});

test("object pulled out of the hand is not reported as slipped", async () => {
  const { page, errors } = await visit(served);
  await untilReady(page);
  // As wide as the sugar box, and so heavy that the hand rises without it.
  const buffer = Buffer.from(BOX.replaceAll("60", "94").replaceAll("40", "49"));
  await page.setInputFiles("#file", { name: "heavy.obj", mimeType: "model/obj", buffer });
  await page.waitForSelector("#objects [value='file:heavy.obj']:checked");
  await page.fill("#mass", "6000");
  await page.press("#mass", "Tab");
  await page.waitForFunction(() => document.getElementById("info-mass").textContent === "6.00 kg");
  await graspSlowly(page);
  await phase(page, "lift");
  await drag(page);
  await page.waitForFunction(() => document.getElementById("hash").textContent.startsWith("You moved the object"));
  await page.mouse.up();
  assert.equal(await page.textContent("#headline"), "You pulled the object out of the hand: not counted.");
  assert.ok((await page.textContent("#announcement")).startsWith("You pulled the object out of the hand: not counted. Contacts: "));
  assert.deepEqual(errors, []);
  await page.close();
});

test("held object can be dragged after the outcome, which stays", async () => {
  const { page, errors } = await visit(served);
  await untilReady(page);
  await page.click("#grasp");
  await phase(page, "outcome");
  const hash = await page.textContent("#hash");
  const ticks = () => page.evaluate(() => Number(document.getElementById("timeline").max));
  const before = await ticks();
  await page.keyboard.down("Control");
  await drag(page);
  await page.waitForFunction((before) => Number(document.getElementById("timeline").max) > before + 10, before);
  await page.mouse.up();
  await page.keyboard.up("Control");
  // The simulation continues for a limited time so that the released object can settle.
  const released = await ticks();
  await page.waitForFunction((released) => Number(document.getElementById("timeline").max) > released + 20, released);
  await page.waitForTimeout(4000);
  const settled = await ticks();
  await page.waitForTimeout(500);
  assert.equal(await ticks(), settled);
  assert.equal(await page.textContent("#hash"), hash);
  assert.ok(await page.isEnabled("#copy-link"));
  assert.deepEqual(errors, []);
  await page.close();
});
