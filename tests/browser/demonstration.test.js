// What plays: kept demonstrations of a dataset and recorded attempts, dropped onto the page.

import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { open, program, screenshot, untilReady, visit } from "./chromium.js";

let served;
let folder;
before(async () => {
  folder = mkdtempSync(join(tmpdir(), "ngf-"));
  execFileSync(program, ["dataset", "--preset", "smoke", "--out", join(folder, "data")]);
  served = await open();
});
after(async () => {
  await served?.close();
  rmSync(folder, { recursive: true, force: true });
});

function episode(index) {
  const file = join(folder, `${index}.json`);
  execFileSync(program, ["dataset", "episode", join(folder, "data"), String(index), "--out", file]);
  return file;
}

test("a kept demonstration is played, named as such, lifts, and does not count", async () => {
  const { page, complaints } = await visit(served);
  await untilReady(page);
  // Another object stands there: the demonstration brings its own.
  await page.click("#objects label:has(input[value=bleach])");
  await page.setInputFiles("#file", episode(5));
  await page.waitForFunction(
    () => document.getElementById("headline").textContent === "A demonstration closes the hand",
  );
  const note = await page.textContent("#hash");
  assert.match(note, /^Demonstration: episode 5, sugar box at pose 1, of dataset [0-9a-f]{8}\. No policy acts\.$/);
  await screenshot(page, "demonstration");
  await page.waitForSelector("[data-phase=verdict].is-now");
  assert.equal(await page.textContent("#headline"), "Lifted and held.");
  assert.match(await page.textContent("#hash"), /^Demonstration: episode 5, .* ended in state [0-9a-f]{16}$/);
  assert.equal(await page.textContent("#tally"), "None yet with this object");
  assert.ok(await page.isChecked("#objects input[value=sugar_box]"), "its object is chosen");
  // The next attempt is the policy's again.
  await page.click("#grasp");
  await page.waitForFunction(() => document.getElementById("headline").textContent === "The policy closes the hand");
  assert.ok(await page.isHidden("#hash"), "nothing is said of a demonstration any more");
  assert.deepEqual(complaints, []);
  await page.close();
});

test("a recorded attempt is played to the end that it had, and what differs is told", async () => {
  const { page, complaints } = await visit(served);
  await untilReady(page);
  const file = join(folder, "attempt.json");
  execFileSync(program, ["replay", file, "--record", "sugar_box", "--seed", "3"]);
  const played = async (buffer) => {
    await page.click("#objects label:has(input[value=mustard])");
    await page.setInputFiles("#file", { name: "attempt.json", mimeType: "application/json", buffer });
    await page.waitForFunction(
      () => document.getElementById("headline").textContent === "A recorded attempt closes the hand",
    );
    await page.waitForSelector("[data-phase=verdict].is-now");
    return page.textContent("#hash");
  };
  const recorded = JSON.parse(readFileSync(file));
  const end = recorded.state_hash.slice(0, 16);
  assert.equal(
    await played(readFileSync(file)),
    `Recorded attempt: Sugar box, seed 3 ended in state ${end}, as recorded`,
  );
  assert.equal(await page.textContent("#headline"), "Lifted and held.");
  assert.equal(await page.textContent("#tally"), "None yet with this object");
  await screenshot(page, "recorded-attempt");
  const other = Buffer.from(JSON.stringify({ ...recorded, state_hash: "0".repeat(64) }));
  assert.match(await played(other), /, and not in the one that was recorded: something differs here$/);
  assert.deepEqual(complaints, []);
  await page.close();
});

test("an attempt that was saved here plays here", async () => {
  const { page } = await visit(served);
  await untilReady(page);
  await page.click("#grasp");
  await page.waitForSelector("[data-phase=verdict].is-now");
  const [words, end] = [await page.textContent("#headline"), await page.textContent("#hash")];
  const [download] = await Promise.all([page.waitForEvent("download"), page.click("#save-json")]);
  await page.setInputFiles("#file", await download.path().then((path) => {
    const buffer = readFileSync(path);
    return { name: download.suggestedFilename(), mimeType: "application/json", buffer };
  }));
  await page.waitForFunction(() => /^Recorded attempt: .*, as recorded$/.test(document.getElementById("hash").textContent));
  assert.equal(await page.textContent("#headline"), words);
  assert.equal(end.match(/[0-9a-f]{16}$/)[0], (await page.textContent("#hash")).match(/[0-9a-f]{16}/)[0]);
  await page.close();
});

test("what is no demonstration says so, and the scene goes on", async () => {
  const { page } = await visit(served);
  await untilReady(page);
  const good = JSON.parse(readFileSync(episode(0)));
  for (const [name, text, cause] of [
    ["letter.json", "Dear reader", /letter\.json cannot be played/],
    ["other.json", JSON.stringify({ ...good, object: "0".repeat(64), name: "my mesh" }), /"my mesh", which is not here/],
    ["old.json", JSON.stringify({ ...good, scene: "0".repeat(64) }), /another scene/],
  ]) {
    await page.setInputFiles("#file", { name, mimeType: "application/json", buffer: Buffer.from(text) });
    // Its name is there while it is read; what is wrong with it comes after.
    await page.waitForFunction((cause) => new RegExp(cause).test(document.body.textContent), cause.source);
    assert.ok((await page.textContent("body")).includes(name), `${name} is not named`);
  }
  assert.ok(await page.isEnabled("#grasp"));
  await page.close();
});
