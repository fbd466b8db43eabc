// Playback of dropped files: demonstrations of a dataset and recorded attempts.

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
  execFileSync(program, ["dataset", "generate", "--preset", "smoke", "--out", join(folder, "data")]);
  served = await open();
});
after(async () => {
  await served?.close();
  rmSync(folder, { recursive: true, force: true });
});

function episode(index) {
  const file = join(folder, `${index}.json`);
  execFileSync(program, ["dataset", "export-episode", join(folder, "data"), String(index), "--out", file]);
  return file;
}

test("demonstration is labelled, lifts and is not counted", async () => {
  const { page, errors } = await visit(served);
  await untilReady(page);
  // The demonstration replaces the current object by its own.
  await page.click("#objects label:has(input[value=bleach])");
  await page.setInputFiles("#file", episode(5));
  await page.waitForFunction(
    () => document.getElementById("headline").textContent === "Replaying a demonstration",
  );
  const note = await page.textContent("#hash");
  assert.match(note, /^Demonstration, episode 5: sugar box, pose 1, dataset [0-9a-f]{8} \(no policy\)$/);
  await screenshot(page, "demonstration");
  await page.waitForSelector("[data-phase=outcome].is-now");
  assert.equal(await page.textContent("#headline"), "Lifted and held.");
  assert.match(await page.textContent("#hash"), /^Demonstration, episode 5: .*\. Final state: [0-9a-f]{16}$/);
  assert.equal(await page.textContent("#tally"), "No attempts with this object yet");
  assert.ok(await page.isChecked("#objects input[value=sugar_box]"), "its object is selected");
  // The policy controls the next attempt.
  await page.click("#grasp");
  await page.waitForFunction(() => document.getElementById("headline").textContent === "Policy: grasping");
  assert.ok(await page.isHidden("#hash"), "the demonstration is no longer mentioned");
  assert.deepEqual(errors, []);
  await page.close();
});

test("recorded attempt replays to its final state, and a different hash is reported", async () => {
  const { page, errors } = await visit(served);
  await untilReady(page);
  const file = join(folder, "attempt.json");
  execFileSync(program, ["record", "--object", "sugar_box", "--seed", "3", "--out", file]);
  const replay = async (buffer) => {
    await page.click("#objects label:has(input[value=mustard])");
    await page.setInputFiles("#file", { name: "attempt.json", mimeType: "application/json", buffer });
    await page.waitForFunction(
      () => document.getElementById("headline").textContent === "Replaying a recorded attempt",
    );
    await page.waitForSelector("[data-phase=outcome].is-now");
    return page.textContent("#hash");
  };
  const recorded = JSON.parse(readFileSync(file));
  const end = recorded.final_state_hash.slice(0, 16);
  assert.equal(
    await replay(readFileSync(file)),
    `Recorded attempt: Sugar box, seed 3. Final state: ${end} (matches the recording)`,
  );
  assert.equal(await page.textContent("#headline"), "Lifted and held.");
  assert.equal(await page.textContent("#tally"), "No attempts with this object yet");
  await screenshot(page, "recorded-attempt");
  const other = Buffer.from(JSON.stringify({ ...recorded, final_state_hash: "0".repeat(64) }));
  assert.match(await replay(other), / \(differs from the recording\)$/);
  assert.deepEqual(errors, []);
  await page.close();
});

test("attempt saved by the page can be replayed", async () => {
  const { page } = await visit(served);
  await untilReady(page);
  await page.click("#grasp");
  await page.waitForSelector("[data-phase=outcome].is-now");
  const [headline, end] = [await page.textContent("#headline"), await page.textContent("#hash")];
  const [download] = await Promise.all([page.waitForEvent("download"), page.click("#save-json")]);
  await page.setInputFiles("#file", await download.path().then((path) => {
    const buffer = readFileSync(path);
    return { name: download.suggestedFilename(), mimeType: "application/json", buffer };
  }));
  await page.waitForFunction(() => /^Recorded attempt: .* \(matches the recording\)$/.test(document.getElementById("hash").textContent));
  assert.equal(await page.textContent("#headline"), headline);
  assert.equal(end.match(/[0-9a-f]{16}$/)[0], (await page.textContent("#hash")).match(/[0-9a-f]{16}/)[0]);
  await page.close();
});

test("invalid recordings are reported and do not affect the scene", async () => {
  const { page } = await visit(served);
  await untilReady(page);
  const good = JSON.parse(readFileSync(episode(0)));
  for (const [name, text, message] of [
    ["letter.json", "Dear reader", /letter\.json cannot be replayed/],
    ["other.json", JSON.stringify({ ...good, object_hash: "0".repeat(64), object_name: "my mesh" }), /"my mesh", which is not a built-in object/],
    ["old.json", JSON.stringify({ ...good, scene_hash: "0".repeat(64) }), /another scene/],
  ]) {
    await page.setInputFiles("#file", { name, mimeType: "application/json", buffer: Buffer.from(text) });
    // The file name appears while the file is read, the error later.
    await page.waitForFunction((message) => new RegExp(message).test(document.body.textContent), message.source);
    assert.ok((await page.textContent("body")).includes(name), `no mention of ${name}`);
  }
  assert.ok(await page.isEnabled("#grasp"));
  await page.close();
});
