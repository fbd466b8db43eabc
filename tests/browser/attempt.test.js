// Attempts: outcome, reproducibility, playback controls, restart of the worker.

import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { fileURLToPath } from "node:url";
import { newPage, grasp, open, TIMEOUT_MS, program, screenshot, untilReady, visit } from "./chromium.js";

let served;
before(async () => (served = await open()));
after(() => served?.close());

test("attempt with the sugar box has an outcome and is reproducible from its seed", async () => {
  const { page } = await visit(served);
  await untilReady(page);
  assert.match(await page.textContent("#model"), /^Loaded: default$/);
  await page.selectOption("#speed", "4");
  const first = await grasp(page, 0);
  await screenshot(page, "outcome");
  assert.match(first.hash, /^[0-9a-f]{64}$/);
  assert.match(first.tally, /^[01] of 1 lifted$/);
  assert.ok((await page.textContent("#announcement")).startsWith(first.headline), "the outcome is announced");
  const repeated = await grasp(page, 0);
  assert.deepEqual(repeated, first, "a repeat has the same result and counts once");
  const other = await grasp(page, 1);
  assert.notEqual(other.hash, first.hash);
  assert.match(other.tally, /^[012] of 2 lifted$/);
  await page.click("label:has([value=bleach])");
  await page.waitForFunction(() => document.getElementById("tally").textContent.startsWith("No attempts"));
  assert.ok(await page.isHidden("#hash"), "no hash for a new object");
  await page.close();
});

test("seeds 0 to 4 have the same final state in the browser and natively", async () => {
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
  for (const { seed, outcome, final_state_hash } of rows) {
    const got = await grasp(page, seed);
    assert.equal(got.hash, final_state_hash, `final state of seed ${seed}`);
    assert.equal(got.headline === "Lifted and held.", outcome.result === "lifted");
  }
  await page.close();
});

test("first attempt starts automatically and can be paused, stepped and reset", async () => {
  const { page } = await visit(served, { reducesMotion: false });
  // On a slow machine the approach ends before the first frame is rendered.
  await page.waitForSelector("#phases .is-now");
  await page.click("#pause");
  await page.waitForFunction(() => document.getElementById("rate").textContent === "Paused");
  await page.click("#step");
  assert.equal(await page.textContent("#rate"), "Paused");
  await page.click("#reset");
  await page.waitForFunction(() => !document.querySelector("#phases .is-now"));
  await page.close();
});

test("late recording does not replace a pose set by the user", async () => {
  const { page } = await newPage(served, { reducesMotion: false });
  // Delays the body of the recording.
  await page.addInitScript(() => {
    const { blob } = Response.prototype;
    Response.prototype.blob = async function () {
      const body = await blob.call(this);
      await new Promise((resolve) => (globalThis.deliver = resolve));
      return body;
    };
  });
  // The recording is shown only until the policy is loaded.
  await page.route("**/weights**", () => {});
  await page.goto(served.address);
  await page.waitForFunction(() => globalThis.deliver);
  const before = await page.inputValue("#pose-x");
  await page.click("#new-pose");
  await page.waitForFunction((x) => document.getElementById("pose-x").value !== x, before);
  const pose = await page.inputValue("#pose-x");
  await page.evaluate(() => globalThis.deliver());
  await page.waitForTimeout(300);
  assert.equal(await page.inputValue("#pose-x"), pose);
  assert.equal(await page.locator("#phases .is-now").count(), 0);
  await page.close();
});

test("next attempt keeps the focus", async () => {
  const { page } = await visit(served);
  await untilReady(page);
  await page.selectOption("#speed", "4");
  const untilOutcome = () => page.waitForSelector("[data-phase=outcome].is-now", { timeout: TIMEOUT_MS });
  await page.click("#grasp");
  await untilOutcome();
  await page.focus("#timeline");
  await page.keyboard.press("g");
  await page.waitForSelector("[data-phase=approach].is-now");
  await untilOutcome();
  await page.keyboard.press("ArrowLeft");
  await page.waitForFunction(() => document.getElementById("rate").textContent === "Paused");
  assert.ok(Number(await page.inputValue("#timeline")) > 0);
  await page.close();
});

// Records the headlines and the notes of the attempts, and the note while the policy or the planner acts.
function recordTexts() {
  globalThis.texts = { headline: [], hash: [] };
  globalThis.notesOfActor = [];
  // Null: hidden.
  const shownText = (id) => {
    const { hidden = true, textContent } = document.getElementById(id) ?? {};
    return hidden ? null : textContent;
  };
  new MutationObserver(() => {
    for (const [id, texts] of Object.entries(globalThis.texts)) {
      const text = shownText(id);
      if (text !== null && texts.at(-1) !== text) texts.push(text);
    }
    if (/^(Policy|Planner): grasping$/.test(shownText("headline"))) globalThis.notesOfActor.push(shownText("hash"));
  }).observe(document, { subtree: true, childList: true, characterData: true, attributes: true });
}

// Waits until the policy or the planner acts; the note of the recording is hidden then.
async function untilNoteIsHidden(page) {
  await page.waitForFunction(() => globalThis.notesOfActor.length > 0);
  const notes = await page.evaluate(() => globalThis.notesOfActor);
  assert.deepEqual(notes.filter((note) => note !== null), []);
}

test("recording plays only until the policy is loaded, which then acts", async () => {
  const { page } = await newPage(served, { reducesMotion: false });
  await page.addInitScript(recordTexts);
  await page.route("**/weights**", async (route) => {
    await page.waitForFunction(() => document.getElementById("hash").textContent.startsWith("Demonstration,"));
    await route.continue();
  });
  await page.goto(served.address);
  await page.waitForFunction(() => document.getElementById("model").textContent.startsWith("Loaded"));
  assert.equal(await page.textContent("#announcement"), "Loaded: default");
  await untilNoteIsHidden(page);
  await page.selectOption("#speed", "4");
  await page.waitForFunction(() => document.getElementById("hash").textContent.startsWith("Seed 0. Final state:"));
  // The recording ended without an outcome, and its note with it.
  const { hash } = await page.evaluate(() => globalThis.texts);
  assert.match(hash[0], /^Demonstration,.* \(no policy\)$/);
  assert.equal(hash.length, 2, hash.join("\n"));
  await untilNoteIsHidden(page);
  assert.doesNotMatch(hash[1], /custom pose/);
  assert.match(await page.textContent("#tally"), /^[01] of 1 lifted$/);

  // A requested policy acts at once, without a recording.
  await page.unrouteAll();
  await page.goto(`${served.address}?model=default`);
  await page.waitForFunction(() => document.getElementById("headline").textContent === "Policy: grasping");
  const requested = await page.evaluate(() => globalThis.texts);
  assert.deepEqual(requested.hash, []);
  assert.ok(!requested.headline.some((text) => text.includes("demonstration")), requested.headline.join());

  // Without a policy, an attempt during the recording starts at the pose of its seed.
  await page.route("**/models/**", (route) => route.fulfill({ status: 404 }));
  await page.goto(served.address);
  await page.waitForFunction(() => document.getElementById("hash").textContent.startsWith("Demonstration,"));
  await page.click("#grasp");
  await untilNoteIsHidden(page);
  await page.selectOption("#speed", "4");
  await page.waitForFunction(() => document.getElementById("hash").textContent.startsWith("Seed 0. Final state:"));
  await page.close();
});

test("stopped worker is reported and restarts with the same object", async () => {
  const { page } = await visit(served);
  await untilReady(page);
  await page.click("label:has([value=mustard])");
  await page.waitForFunction(() => document.getElementById("info-mass").textContent === "603 g");
  await page.workers()[0].evaluate(() => {
    setTimeout(() => {
      throw new Error("stopped by a test");
    });
  });
  const card = await page.waitForSelector('[data-code="worker_stopped"]');
  assert.ok(await page.isDisabled("#grasp"), "attempts are disabled meanwhile");
  assert.match(await card.textContent(), /stopped by a test/);
  await page.click(".failure .retry");
  await page.waitForSelector('[data-code="worker_stopped"]', { state: "detached" });
  await untilReady(page);
  assert.equal(await page.textContent("#info-mass"), "603 g");
  assert.ok(await page.isChecked("[value=mustard]"));
  const before = await page.inputValue("#pose-x");
  await page.click("#new-pose");
  await page.waitForFunction((x) => document.getElementById("pose-x").value !== x, before);
  await page.close();
});
