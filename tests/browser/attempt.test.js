// An attempt from beginning to verdict.

import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { mkdtempSync, readFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { fileURLToPath } from "node:url";
import { open, screenshot, untilReady, visit } from "./chromium.js";

let served;
before(async () => (served = await open()));
after(() => served.close());

async function grasp(page, seed) {
  await page.fill("#seed", String(seed));
  await page.press("#seed", "Enter");
  await page.click("#grasp");
  await page.waitForSelector("[data-phase=verdict].is-now");
  await page.waitForFunction((seed) => document.getElementById("hash").textContent.startsWith(`Seed ${seed} `), seed);
  return {
    words: await page.textContent("#headline"),
    hash: await page.getAttribute("#hash", "title"),
    tally: await page.textContent("#tally"),
  };
}

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
  assert.deepEqual([again.words, again.hash], [first.words, first.hash]);
  await page.close();
});

test("seeds 0 to 4 end in the browser as they do natively", async () => {
  const report = join(mkdtempSync(join(tmpdir(), "ngf-")), "report.json");
  const options = ["--object", "sugar_box", "--attempts", "5", "--seed", "0", "--json", report];
  const model = fileURLToPath(new URL("../../models/default", import.meta.url));
  execFileSync(process.env.NGF, ["evaluate", "--model", model, ...options]);
  const [{ rows }] = JSON.parse(readFileSync(report, "utf8"));
  const { page } = await visit(served);
  await untilReady(page);
  await page.selectOption("#speed", "4");
  for (const { seed, verdict, state_hash } of rows) {
    await page.fill("#seed", String(seed));
    await page.press("#seed", "Enter");
    const got = await grasp(page, seed);
    assert.equal(got.hash, state_hash, `the final state of seed ${seed}`);
    assert.equal(got.words === "Lifted and held.", verdict.outcome === "lifted");
  }
  await page.close();
});

test("an attempt begins by itself, pauses, steps and is reset", async () => {
  const { page } = await visit(served, { isCalm: false });
  await page.waitForSelector("[data-phase=approach].is-now");
  await page.click("#pause");
  await page.waitForFunction(() => document.getElementById("rate").textContent === "Paused");
  await page.click("#step");
  assert.equal(await page.textContent("#rate"), "Paused");
  await page.click("#reset");
  await page.waitForFunction(() => !document.querySelector("#phases .is-now"));
  await page.close();
});

test("a simulation that stops says so and can be restarted", async () => {
  const { page } = await visit(served);
  await untilReady(page);
  await page.workers()[0].evaluate(() => {
    setTimeout(() => {
      throw new Error("stopped by a test");
    });
  });
  const card = await page.waitForSelector('[data-code="engine_stopped"]');
  assert.match(await card.textContent(), /stopped by a test/);
  await page.click(".failure .again");
  await page.waitForSelector('[data-code="engine_stopped"]', { state: "detached" });
  await page.click("#new-pose");
  await page.waitForFunction(() => document.getElementById("seed").value === "1");
  await page.close();
});
