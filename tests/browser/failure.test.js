// Failed attempts: evidence, the second after the outcome, and layers and cards that stay true.

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { after, before, test } from "node:test";
import { grasp, open, screenshot, untilReady, visit } from "./chromium.js";
import { BOX, bottle } from "./meshes.js";

let served;
before(async () => (served = await open()));
after(() => served?.close());

const obj = (name, text) => ({ name, mimeType: "model/obj", buffer: Buffer.from(text) });

// Runs in the page: first tick of the outcome, and last tick.
const ticks = (page) =>
  page.evaluate(() => {
    const { value, max } = document.getElementById("timeline");
    return { tick: Number(value), last: Number(max) };
  });

// Number of pixels by which two screenshots differ clearly.
function differentPixels(page, first, second) {
  return page.evaluate(
    async (images) => {
      const pixels = await Promise.all(
        images.map(async (base64) => {
          const image = new Image();
          image.src = `data:image/png;base64,${base64}`;
          await image.decode();
          const context = Object.assign(document.createElement("canvas"), { width: image.width, height: image.height }).getContext("2d");
          context.drawImage(image, 0, 0);
          return context.getImageData(0, 0, image.width, image.height).data;
        }),
      );
      let count = 0;
      for (let i = 0; i < pixels[0].length; i += 4) {
        if ([0, 1, 2].some((k) => Math.abs(pixels[0][i + k] - pixels[1][i + k]) > 40)) count += 1;
      }
      return count;
    },
    [first, second].map((image) => image.toString("base64")),
  );
}

// Screenshot of the resting scene at full resolution.
async function view(page) {
  await page.waitForTimeout(700);
  return page.locator("#view").screenshot();
}

test("failure states its evidence, and the simulation shows one more second", async () => {
  const { page, errors } = await visit(served, { pixelRatio: 1 });
  await untilReady(page);
  // A long name is shortened in the middle and complete on hover.
  const name = "006_heavy_bottle_textured_scan_01.obj";
  // A y-up bottle that is too heavy for the hand.
  await page.setInputFiles("#file", obj(name, bottle(2000).replaceAll(/v (\S+) (\S+) (\S+)/g, "v $1 $3 $2")));
  const item = page.locator(`#objects label:has([value='file:${name}'])`);
  await item.locator(":checked").waitFor({ state: "attached" });
  assert.equal(await item.getAttribute("title"), name);
  const [label, end] = await item.evaluate((label) => {
    const range = document.createRange();
    range.selectNode(label.querySelector(".name").lastChild);
    return [label.getBoundingClientRect().right, range.getBoundingClientRect().right];
  });
  assert.ok(end <= label, `the end of the name is visible: ${end} of ${label}`);
  await page.fill("#mass", "6000");
  await page.press("#mass", "Tab");
  await page.waitForFunction(() => document.getElementById("info-mass").textContent === "6.00 kg");
  const { headline, hash } = await grasp(page, 4);
  assert.notEqual(headline, "Lifted and held.");
  const evidence = await page.textContent("#evidence");
  assert.match(
    evidence,
    /^Contacts: [a-z0-9, ]+( \(.* during the lift\))?\. Slip in the hand: [\d.]+ cm \(limit 3\), \d+° \(limit 30\)\. Height [\d.]+ cm \(required 10, highest [\d.]+\)\. Moved [\d.]+ cm sideways, tilted \d+°\. The last second is not counted\.$/,
  );
  assert.ok((await page.textContent("#announcement")).startsWith(`${headline} ${evidence.split(" The last")[0]}`));
  await page.waitForFunction(() => document.getElementById("clock").textContent === "+1.0 s");
  const { last } = await ticks(page);
  assert.match(await page.getAttribute("#timeline", "aria-valuetext"), /^1\.00 seconds after the outcome, not counted$/);
  await screenshot(page, "failure");
  await page.click("#phases [data-phase=outcome] button");
  await page.waitForFunction((last) => Number(document.getElementById("timeline").value) === last - 30, last);
  // Neither the recording nor its replay contains the additional second.
  const [download] = await Promise.all([page.waitForEvent("download"), page.click("#save-json")]);
  const recording = JSON.parse(readFileSync(await download.path()));
  assert.equal(recording.final_state_hash, hash);
  assert.equal(recording.targets.length, last - 30 + 1);
  await page.setInputFiles("#file", { name: "attempt.json", mimeType: "application/json", buffer: Buffer.from(JSON.stringify(recording)) });
  await page.waitForFunction(() => document.getElementById("hash").textContent.endsWith("(matches the recording)"));
  assert.deepEqual([await page.textContent("#headline"), await page.textContent("#evidence")], [headline, evidence]);
  // A new attempt has no evidence yet.
  await page.click("#grasp");
  await page.waitForSelector("[data-phase=approach].is-now");
  assert.ok(await page.isHidden("#evidence"));
  assert.deepEqual(errors, []);
  await page.close();
});

test("palm trajectory and contact forces are solid and stay after the outcome", async () => {
  const { page, errors } = await visit(served, { pixelRatio: 1 });
  await untilReady(page);
  await page.keyboard.press("c");
  // Shown from the start, so that the trajectory contains every tick.
  await page.keyboard.press("t");
  await grasp(page, 0);
  await page.keyboard.press("f");
  await screenshot(page, "solid-layers");
  const both = await view(page);
  await page.keyboard.press("t");
  const forces = await view(page);
  await page.keyboard.press("f");
  const none = await view(page);
  // Lines of one pixel would cover about a hundred and a few dozen pixels.
  const [trail, arrows] = [await differentPixels(page, both, forces), await differentPixels(page, forces, none)];
  assert.ok(trail > 300 && arrows > 200, `${trail} and ${arrows} pixels`);
  assert.deepEqual(errors, []);
  await page.close();
});

test("palm trajectory stays while the attempt is paused", async () => {
  const { page, errors } = await visit(served, { pixelRatio: 1 });
  await untilReady(page);
  await page.keyboard.press("c");
  await page.keyboard.press("t");
  await page.click("#grasp");
  // Slow enough that the lift is rendered.
  await page.waitForSelector("[data-phase=policy].is-now");
  await page.selectOption("#speed", "0.25");
  await page.waitForSelector("[data-phase=lift].is-now");
  await page.click("#pause");
  await page.waitForFunction(() => document.getElementById("rate").textContent === "Paused");
  const { tick } = await ticks(page);
  // Each of these requests repeats the frame of the current tick.
  for (const speed of ["2", "0.25"]) await page.selectOption("#speed", speed);
  await page.evaluate(() => document.activeElement.blur());
  const shown = await view(page);
  await page.keyboard.press("t");
  const trail = await differentPixels(page, shown, await view(page));
  assert.equal((await ticks(page)).tick, tick);
  assert.ok(tick > 30 && trail > 100, `${trail} pixels at tick ${tick}`);
  assert.deepEqual(errors, []);
  await page.close();
});

test("error about a file disappears with the next object, and an invalid seed is refused", async () => {
  const { page } = await visit(served);
  await untilReady(page);
  await page.setInputFiles("#file", obj("box.obj", BOX));
  await page.waitForSelector("#objects [value='file:box.obj']:checked");
  await page.click("#unit-choice [value=m]");
  await page.waitForSelector("[data-code=invalid_mesh]");
  await page.click("#unit-choice [value=mm]");
  await page.waitForSelector("[data-code=invalid_mesh]", { state: "detached" });
  await page.fill("#seed", "7");
  await page.press("#seed", "Enter");
  await page.click("#grasp");
  await page.waitForSelector("[data-phase=approach].is-now");
  for (const invalid of ["-5", "", "1.5", "4294967296"]) {
    await page.fill("#seed", invalid);
    await page.press("#seed", "Tab");
    assert.equal(await page.inputValue("#seed"), "7", invalid);
  }
  assert.equal(await page.textContent("#announcement"), "A seed is a whole number from 0 to 4294967295.");
  // The attempt continues.
  await page.selectOption("#speed", "4");
  await page.waitForSelector("[data-phase=outcome].is-now");
  assert.match(await page.textContent("#hash"), /^Seed 7\. Final state/);
  await page.close();
});
