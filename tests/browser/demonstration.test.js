// Kept demonstrations of a dataset, dropped onto the page and played there.

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
