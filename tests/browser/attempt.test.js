// An attempt from beginning to verdict.

import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { fileURLToPath } from "node:url";
import { blank, grasp, open, PATIENCE, program, screenshot, untilReady, visit } from "./chromium.js";

let served;
before(async () => (served = await open()));
after(() => served?.close());

test("the sugar box gets a verdict, and the same seed the same end", async () => {
  const { page } = await visit(served);
  await untilReady(page);
  assert.match(await page.textContent("#model"), /Policy "default" acts/);
  await page.selectOption("#speed", "4");
  const first = await grasp(page, 0);
  await screenshot(page, "verdict");
  assert.match(first.hash, /^[0-9a-f]{64}$/);
  assert.match(first.tally, /^[01] of 1 lifted$/);
  assert.ok((await page.textContent("#announcement")).startsWith(first.words), "it is announced");
  const again = await grasp(page, 0);
  assert.deepEqual(again, first, "a repeat ends the same, and is counted once");
  const other = await grasp(page, 1);
  assert.notEqual(other.hash, first.hash);
  assert.match(other.tally, /^[012] of 2 lifted$/);
  await page.click("label:has([value=bleach])");
  await page.waitForFunction(() => document.getElementById("tally").textContent.startsWith("None yet"));
  assert.ok(await page.isHidden("#hash"), "another object has no hash yet");
  await page.close();
});

test("seeds 0 to 4 end in the browser as they do natively", async () => {
  const folder = mkdtempSync(join(tmpdir(), "ngf-"));
  const report = join(folder, "report.json");
  const options = ["--object", "sugar_box", "--attempts", "5", "--seed", "0", "--json", report];
  const model = fileURLToPath(new URL("../../models/default", import.meta.url));
  execFileSync(program, ["evaluate", "--model", model, ...options]);
  const [{ rows }] = JSON.parse(readFileSync(report, "utf8"));
  rmSync(folder, { recursive: true });
  const { page } = await visit(served);
  await untilReady(page);
  await page.selectOption("#speed", "4");
  for (const { seed, verdict, state_hash } of rows) {
    const got = await grasp(page, seed);
    assert.equal(got.hash, state_hash, `the final state of seed ${seed}`);
    assert.equal(got.words === "Lifted and held.", verdict.outcome === "lifted");
  }
  await page.close();
});

test("an attempt begins by itself, pauses, steps and is reset", async () => {
  const { page } = await visit(served, { isCalm: false });
  // On a slow machine the approach is over before the first picture is there.
  await page.waitForSelector("#phases .is-now");
  await page.click("#pause");
  await page.waitForFunction(() => document.getElementById("rate").textContent === "Paused");
  await page.click("#step");
  assert.equal(await page.textContent("#rate"), "Paused");
  await page.click("#reset");
  await page.waitForFunction(() => !document.querySelector("#phases .is-now"));
  await page.close();
});

test("a recording that comes late does not take over from whoever has begun", async () => {
  const { page } = await blank(served, { isCalm: false });
  // It has been answered, but is not there yet.
  await page.addInitScript(() => {
    const { blob } = Response.prototype;
    Response.prototype.blob = async function () {
      const whole = await blob.call(this);
      await new Promise((resolve) => (globalThis.come = resolve));
      return whole;
    };
  });
  await page.goto(served.address);
  await untilReady(page);
  await page.waitForFunction(() => globalThis.come);
  const before = await page.inputValue("#pose-x");
  await page.click("#new-pose");
  await page.waitForFunction((x) => document.getElementById("pose-x").value !== x, before);
  const stands = await page.inputValue("#pose-x");
  await page.evaluate(() => globalThis.come());
  await page.waitForTimeout(300);
  assert.equal(await page.inputValue("#pose-x"), stands);
  assert.equal(await page.locator("#phases .is-now").count(), 0);
  await page.close();
});

test("the next attempt leaves the focus where it is", async () => {
  const { page } = await visit(served);
  await untilReady(page);
  await page.selectOption("#speed", "4");
  const isOver = () => page.waitForSelector("[data-phase=verdict].is-now", { timeout: PATIENCE });
  await page.click("#grasp");
  await isOver();
  await page.focus("#timeline");
  await page.keyboard.press("g");
  await page.waitForSelector("[data-phase=approach].is-now");
  await isOver();
  await page.keyboard.press("ArrowLeft");
  await page.waitForFunction(() => document.getElementById("rate").textContent === "Paused");
  assert.ok(Number(await page.inputValue("#timeline")) > 0);
  await page.close();
});

test("a recording goes on to its verdict though the policy comes meanwhile, and then the policy shows itself", async () => {
  const { page } = await blank(served, { isCalm: false });
  await page.route("**/weights**", async (route) => {
    await page.waitForFunction(() => document.getElementById("hash").textContent.startsWith("Demonstration:"));
    await route.continue();
  });
  await page.goto(served.address);
  await page.waitForFunction(() => document.getElementById("model").textContent.startsWith("Policy"));
  await page.selectOption("#speed", "4");
  assert.equal(await page.textContent("#announcement"), 'Policy "default" acts.');
  // What is announced stays until the next verdict.
  await page.waitForFunction(() => document.getElementById("announcement").textContent.endsWith("lifted."));
  assert.match(await page.textContent("#announcement"), / 0 of 0 lifted\.$/, "a recording does not count");
  await page.waitForFunction(() => document.getElementById("hash").textContent.startsWith("Seed 0 ended"));
  assert.match(await page.textContent("#tally"), /^[01] of 1 lifted$/);
  await page.close();
});

test("a simulation that stops says so, can be restarted, and keeps the object", async () => {
  const { page } = await visit(served);
  await untilReady(page);
  await page.click("label:has([value=mustard])");
  await page.waitForFunction(() => document.getElementById("report-mass").textContent === "603 g");
  await page.workers()[0].evaluate(() => {
    setTimeout(() => {
      throw new Error("stopped by a test");
    });
  });
  const card = await page.waitForSelector('[data-code="engine_stopped"]');
  assert.ok(await page.isDisabled("#grasp"), "nothing can be tried meanwhile");
  assert.match(await card.textContent(), /stopped by a test/);
  await page.click(".failure .again");
  await page.waitForSelector('[data-code="engine_stopped"]', { state: "detached" });
  await untilReady(page);
  assert.equal(await page.textContent("#report-mass"), "603 g");
  assert.ok(await page.isChecked("[value=mustard]"));
  const before = await page.inputValue("#pose-x");
  await page.click("#new-pose");
  await page.waitForFunction((x) => document.getElementById("pose-x").value !== x, before);
  await page.close();
});
