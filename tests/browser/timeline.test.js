// Timeline, diagnostics, policies, comparison, batches, grasp search and share links.

import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { a11yViolations, newPage, grasp, open, program, restart, root, screenshot, untilReady, visit } from "./chromium.js";
import { BOX } from "./meshes.js";

let served;
before(async () => (served = await open()));
after(() => served?.close());

function cube(side) {
  const corners = [0, 1, 2, 3, 4, 5, 6, 7].map((k) => `v ${[k & 1, (k >> 1) & 1, (k >> 2) & 1].map((bit) => bit * side).join(" ")}`);
  const faces = ["1 3 4 2", "5 6 8 7", "1 2 6 5", "3 7 8 4", "1 5 7 3", "2 4 8 6"].map((face) => `f ${face}`);
  return { name: "cube.obj", mimeType: "model/obj", buffer: Buffer.from([...corners, ...faces].join("\n")) };
}

/** Waits for the end of a batch: up to 40 attempts of two workers, on a machine that may be busy. */
const untilBatchEnds = (page) =>
  page.waitForFunction(() => document.getElementById("batch-run").textContent === "Run", undefined, { timeout: 300_000 });

test("timeline slider shows any tick, and playback continues from it", async () => {
  const { page, errors } = await visit(served);
  await untilReady(page);
  const { headline } = await grasp(page, 0);
  const last = Number(await page.inputValue("#timeline"));
  assert.ok(last > 60 && last === Number(await page.getAttribute("#timeline", "max")));
  await page.click("#phases [data-phase=policy] button");
  await page.waitForSelector("[data-phase=policy].is-now");
  const policy = Number(await page.inputValue("#timeline"));
  await page.click("#back");
  await page.waitForSelector("[data-phase=approach].is-now");
  assert.equal(Number(await page.inputValue("#timeline")), policy - 1);
  await page.click("#step");
  await page.waitForSelector("[data-phase=policy].is-now");
  await page.click("#pause");
  await page.waitForSelector("[data-phase=outcome].is-now");
  assert.equal(await page.textContent("#headline"), headline, "the outcome is shown again");
  assert.equal(await page.textContent("#tally"), "1 of 1 lifted", "playback does not count as an attempt");
  assert.deepEqual(errors, []);
  await page.close();
});

test("policy internals are plotted for every joint and over time", async () => {
  const { page } = await visit(served);
  await untilReady(page);
  const lines = () => page.$$eval("#plots polyline", (lines) => lines.map((line) => line.getAttribute("points")));
  await page.click("#diagnostics summary");
  await grasp(page, 0);
  assert.equal(await page.locator(".joint").count(), 23);
  // Energy, four fabric terms, damping, limit margin. Plots contain every tick, also at high speed.
  const ticks = Number(await page.getAttribute("#timeline", "max")) + 1;
  await page.waitForFunction((ticks) => document.querySelector("#plots polyline").getAttribute("points").split(" ").length === ticks, ticks);
  const live = await lines();
  assert.equal(live.length, 7);
  assert.match(await page.textContent("#plots .axis"), /^0\d+\.\d s$/);
  assert.match(await page.textContent("#plots .axis-max"), /^[\d.]+(e[+-]\d+)?$/);
  assert.ok(live.every((points) => points.split(" ").length > 30), String(live));
  // Opening the plots after the attempt shows the same curves.
  await page.click("#diagnostics summary");
  await page.click("#new-pose");
  await grasp(page, 0);
  await page.click("#diagnostics summary");
  await page.waitForFunction((expected) => document.querySelector("#plots polyline").getAttribute("points") === expected, live[0]);
  assert.deepEqual(await lines(), live);
  await page.locator("#diagnostics").scrollIntoViewIfNeeded();
  await screenshot(page, "diagnostics");
  await page.close();
});

test("selected policy is loaded and kept after a reload", async () => {
  const { page, errors } = await visit(served);
  await untilReady(page);
  const untilLoaded = (id) => page.waitForFunction((id) => document.getElementById("model").textContent === `Loaded: ${id}`, id);
  await untilLoaded("default");
  // The lists are filled before they are opened.
  for (const list of ["#policy", "#compare"]) await page.waitForSelector(`${list} [value=mlp-pcd]`, { state: "attached" });
  await page.selectOption("#policy", "mlp-pcd");
  await untilLoaded("mlp-pcd");
  assert.equal(new URL(page.url()).search, "?model=mlp-pcd");
  await grasp(page, 0);
  assert.match(await page.textContent("#hash"), /^Seed 0\. /);
  await page.reload();
  await untilReady(page);
  await untilLoaded("mlp-pcd");
  assert.equal(await page.inputValue("#policy"), "mlp-pcd");
  await page.locator("#policy").scrollIntoViewIfNeeded();
  await screenshot(page, "policy");
  // A policy deleted after the list was fetched: the previous one stays loaded, and its attempt has a link.
  await grasp(page, 0);
  await page.focus("#policy");
  await page.waitForSelector("#policy [value=ycb-two]", { state: "attached" });
  await page.route("**/models/ycb-two/**", (route) => route.fulfill({ status: 404 }));
  await page.selectOption("#policy", "ycb-two");
  await page.waitForSelector(".failures [data-code]");
  await page.waitForFunction(() => document.getElementById("policy").value === "mlp-pcd");
  assert.ok(await page.isEnabled("#copy-link"));
  // A restarted worker loads the current policy, not the missing one.
  await restart(page);
  await untilLoaded("mlp-pcd");
  await page.selectOption("#policy", "default");
  await untilLoaded("default");
  assert.equal(new URL(page.url()).search, "");
  // The missing policy is logged to the console.
  assert.ok(errors.every((error) => /404|ycb-two|stopped by a test/.test(error)), errors.join());
  await page.close();
});

test("comparison policy gets the same attempt, with layers", async () => {
  const { page, errors } = await visit(served);
  await untilReady(page);
  await page.click("#objects label:has([value=soup_can])");
  await page.click("#new-pose");
  await page.selectOption("#compare", "default");
  await page.waitForSelector("#view-2", { state: "visible" });
  await page.keyboard.press("t");
  await grasp(page, 4);
  await page.waitForFunction(() => /^default: /.test(document.getElementById("policy-name-2").textContent));
  assert.equal(await page.textContent("#policy-name-1"), await page.textContent("#policy-name-2"), "the same policy has the same outcome");
  await page.click("#phases [data-phase=lift] button");
  await screenshot(page, "comparison");
  await page.click("#new-pose");
  for (const name of ["#policy-name-1", "#policy-name-2"]) assert.equal(await page.textContent(name), "default", "a new pose removes the outcome");
  await page.selectOption("#compare", "");
  await page.waitForSelector("#view-2", { state: "hidden" });
  // An attempt started before the second policy is loaded waits for it instead of using the planner.
  await page.focus("#compare");
  await page.waitForSelector("#compare [value=mlp-pcd]", { state: "attached" });
  await page.selectOption("#compare", "mlp-pcd");
  assert.equal(await page.textContent("#policy-name-2"), "mlp-pcd: loading");
  await page.click("#grasp");
  await page.waitForFunction(() => /^mlp-pcd: [A-Z]/.test(document.getElementById("policy-name-2").textContent));
  assert.equal(await page.locator(".failures [data-code]").count(), 0);
  await page.selectOption("#compare", "");
  await page.waitForSelector("#view-2", { state: "hidden" });
  assert.deepEqual(errors, []);
  // If the second worker stops, no restart of the first is offered.
  const [second] = await Promise.all([page.waitForEvent("worker"), page.selectOption("#compare", "default")]);
  await second.evaluate(() => {
    setTimeout(() => {
      throw new Error("stopped by a test");
    });
  });
  await page.waitForSelector("[data-code=second_worker_stopped]");
  assert.ok(await page.isHidden("[data-code=second_worker_stopped] .retry"));
  await page.waitForSelector("#view-2", { state: "hidden" });
  assert.ok(await page.isEnabled("#grasp"));
  await page.close();
});

test("batch of ten attempts is counted and matches single attempts", async () => {
  const { page } = await visit(served);
  await untilReady(page);
  await page.fill("#seed", "100");
  await page.press("#seed", "Enter");
  await page.selectOption("#batch-count", "10");
  await page.click("#batch-run");
  await page.waitForFunction(() => document.getElementById("batch-run").textContent === "Run" && document.getElementById("batch-summary").textContent.includes("of 10"));
  const [download] = await Promise.all([page.waitForEvent("download"), page.click("#batch-csv")]);
  const rows = readFileSync(await download.path(), "utf8").trim().split("\n").slice(1);
  assert.equal(rows.length, 10);
  const [name, seed, , , , lifted] = rows[3].split(",");
  assert.equal(name, "default");
  const { headline, hash } = await grasp(page, Number(seed));
  assert.ok(rows[3].endsWith(hash), `${rows[3]} and ${hash}`);
  assert.equal(headline === "Lifted and held.", lifted === "true");
  assert.match(await page.textContent("#tally"), /of 10 lifted/, "a repeated attempt counts once");
  // The map has one mark per attempt; a click replays it.
  const lifts = rows.filter((row) => row.split(",")[5] === "true").length;
  assert.equal(await page.locator("#workspace-map-svg .is-lifted").count(), lifts);
  assert.equal(await page.locator("#workspace-map-svg .is-failed").count(), 10 - lifts);
  assert.equal(await page.locator("#batch-failures li").count(), 10 - lifts);
  await page.locator("#workspace-map-svg g").nth(5).click();
  await page.waitForFunction(() => document.getElementById("seed").value === "105");
  // The table offers the same by keyboard.
  await page.focus("#attempts-all summary");
  await page.keyboard.press("Enter");
  assert.equal(await page.locator("#attempts-rows tr").count(), 10);
  assert.equal(await page.locator("#attempts-rows .is-failed").count(), 10 - lifts);
  await page.focus("#attempts-rows button[aria-label='Replay seed 107']");
  await screenshot(page, "batch-table");
  assert.deepEqual(await a11yViolations(page), []);
  await page.keyboard.press("Enter");
  await page.waitForFunction(() => document.getElementById("seed").value === "107");
  // A running batch can be stopped.
  await page.selectOption("#batch-count", "100");
  await page.click("#batch-run");
  await page.waitForFunction(() => /of/.test(document.getElementById("batch-summary").textContent));
  await page.click("#batch-run");
  await untilBatchEnds(page);
  await screenshot(page, "batch");
  await page.close();
});

test("batch compares two policies on the same seeds", async () => {
  const { page, errors } = await visit(served);
  await untilReady(page);
  await page.focus("#compare");
  await page.waitForSelector("#compare [value=mlp-pcd]", { state: "attached" });
  await page.selectOption("#compare", "mlp-pcd");
  await page.waitForFunction(() => document.getElementById("policy-name-2").textContent === "mlp-pcd");
  await page.selectOption("#batch-count", "10");
  await page.click("#batch-run");
  await untilBatchEnds(page);
  assert.match(await page.textContent("#batch-summary"), /^\d+ of 10$/);
  const comparison = await page.textContent("#batch-comparison");
  assert.match(comparison, /^default: \d+ of 10 \([\d.]+ % to \d+ %\), mlp-pcd: \d+ of 10 \([\d.]+ % to \d+ %\)\. Paired \(10 seeds\): \d+ lifted only by default, \d+ only by mlp-pcd\.$/);
  const [download] = await Promise.all([page.waitForEvent("download"), page.click("#batch-csv")]);
  const rows = readFileSync(await download.path(), "utf8").trim().split("\n").slice(1).map((line) => line.split(","));
  const lifted = (name) => rows.filter((row) => row[0] === name).map((row) => row[5] === "true");
  const [first, second] = [lifted("default"), lifted("mlp-pcd")];
  assert.deepEqual([first.length, second.length], [10, 10]);
  const alone = (one, other) => one.filter((lifts, seed) => lifts && !other[seed]).length;
  assert.deepEqual(comparison.match(/\d+/g).slice(-2).map(Number), [alone(first, second), alone(second, first)]);
  await screenshot(page, "batch-of-two");
  // Selecting another object stops both batches; the next batch starts from zero.
  await page.click("#batch-run");
  await page.waitForFunction(() => /mlp-pcd: [12] of/.test(document.getElementById("batch-comparison").textContent));
  await page.click("#objects label:has([value=soup_can])");
  await page.waitForFunction(() => document.getElementById("batch-summary").textContent === "" && document.getElementById("batch-run").textContent === "Run");
  await page.click("#batch-run");
  await page.waitForFunction(() => /mlp-pcd: [01] of 1 /.test(document.getElementById("batch-comparison").textContent));
  // Removing the second policy ends its half of the batch.
  await page.selectOption("#compare", "");
  await untilBatchEnds(page);
  assert.match(await page.textContent("#batch-summary"), /^\d+ of 10$/);
  assert.deepEqual(errors, []);
  await page.close();
});

test("grasp search without a policy finds and plays a grasp of an uploaded mesh", async () => {
  const { page, errors } = await visit(served);
  await untilReady(page);
  await page.setInputFiles("#file", cube(0.06));
  await page.waitForSelector("#objects [value='file:cube.obj']:checked");
  // The search can be stopped, and the scene stays usable meanwhile.
  await page.click("#search");
  await page.click("#new-pose");
  await page.click("#search");
  await page.waitForFunction(() => document.getElementById("search-status").textContent === "Stopped.");
  await page.click("#search");
  // Counts, rate and remaining time are shown.
  await page.waitForFunction(() => /^\d+ grasps tried \(\d/.test(document.getElementById("search-status").textContent));
  await page.waitForFunction(() => /\d selected/.test(document.getElementById("search-status").textContent));
  await page.selectOption("#speed", "4");
  await page.waitForSelector("[data-phase=outcome].is-now");
  assert.equal(await page.textContent("#headline"), "Lifted and held.");
  assert.match(await page.textContent("#hash"), /^Grasp from search \(cube\.obj\)\. Final state:/);
  assert.match(await page.textContent("#share-hint"), /only attempts of a policy/);
  assert.equal(await page.textContent("#tally"), "No attempts with this object yet");
  await screenshot(page, "search");
  // Each grasp can be played.
  await page.click("#search-grasps button");
  await page.waitForSelector("[data-phase=outcome]:not(.is-now)");
  await page.waitForSelector("[data-phase=outcome].is-now");
  assert.match(await page.textContent("#headline"), /^(Lifted and held|Out of reach)/);
  assert.deepEqual(errors, []);
  await page.close();
});

// Finds the first attempt with the given outcome, starting at `seed`; returns its result and share link.
async function linkTo(object, lifts, seed) {
  const context = await served.browser.newContext({ permissions: ["clipboard-read", "clipboard-write"], reducedMotion: "reduce" });
  const page = await context.newPage();
  await page.goto(served.address);
  await untilReady(page);
  await page.click(`#objects label:has([value=${object}])`);
  await page.waitForSelector(`#objects [value=${object}]:checked`);
  let result = await grasp(page, seed);
  for (let next = seed + 1; (result.headline === "Lifted and held.") !== lifts; next += 1) {
    assert.ok(next < seed + 50, `none of 50 attempts ${lifts ? "lifts" : "fails"}`);
    result = await grasp(page, next);
  }
  await page.click("#copy-link");
  await page.waitForFunction(() => document.getElementById("share-hint").textContent === "Copied.");
  const link = await page.evaluate(() => navigator.clipboard.readText());
  await context.close();
  return { ...result, link };
}

test("share link of a failed attempt reproduces the failure, in the page and with ngf replay", async () => {
  const { headline, hash, link } = await linkTo("cracker_box", false, 0);
  const { page, errors } = await newPage(served);
  await page.goto(link);
  await page.waitForFunction(() => document.getElementById("hash").textContent.endsWith("(matches the link)"));
  assert.deepEqual([await page.textContent("#headline"), await page.getAttribute("#hash", "title")], [headline, hash]);
  assert.deepEqual(errors, []);
  await page.close();
  const printed = execFileSync(program, ["replay", link], { cwd: root, encoding: "utf8" }).trim().split("\n");
  assert.deepEqual(printed, [headline, hash]);
});

test("share link reproduces the attempt, in the page and with ngf replay", async () => {
  const { headline, hash, link } = await linkTo("sugar_box", true, 5);

  const { page: other, errors } = await newPage(served);
  await other.goto(link);
  await other.waitForFunction(() => document.getElementById("hash").textContent.endsWith("(matches the link)"));
  assert.equal(await other.getAttribute("#hash", "title"), hash);
  assert.equal(await other.textContent("#headline"), headline);
  assert.deepEqual(errors, []);
  await other.close();

  // A link that a mail program has changed: "#" and "&" are escaped, the parts are in another order, and the end of
  // the sentence belongs to it.
  const [address, fragment] = link.split("#");
  const parts = fragment.split("&").reverse();
  const { page: changed } = await newPage(served);
  await changed.goto(`${address}%23${parts.join("&amp;")}).`);
  await changed.waitForFunction(() => document.getElementById("hash").textContent.endsWith("(matches the link)"));
  assert.equal(await changed.getAttribute("#hash", "title"), hash);
  await changed.goto("about:blank");
  await changed.goto(`${address}#${encodeURIComponent(parts.slice(0, 5).join("&"))}`);
  await changed.waitForSelector("[data-code=invalid_link]:has-text('changed on its way')");
  await changed.close();
  for (const escaped of [link.replace("#", "%23"), `${address}#${parts.join("&amp;")}`, `${link}">`]) {
    const printed = execFileSync(program, ["replay", escaped], { cwd: root, encoding: "utf8" }).trim().split("\n");
    assert.deepEqual(printed, [headline, hash]);
  }

  // In a tab with the demo already open.
  const { page: tab } = await visit(served);
  await untilReady(tab);
  await tab.evaluate((link) => (location.href = link), link);
  await tab.waitForFunction(() => document.getElementById("hash")?.textContent.endsWith("(matches the link)"));
  assert.equal(await tab.getAttribute("#hash", "title"), hash);
  await tab.close();

  // An attempt started by the user is not compared with the link.
  const { page: interrupted } = await newPage(served);
  await interrupted.goto(link);
  await interrupted.waitForSelector("#phases .is-now");
  await grasp(interrupted, 6);
  assert.ok(!(await interrupted.textContent("#hash")).includes("(matches the link)"));
  assert.equal(await interrupted.locator("[data-code=link_result_mismatch]").count(), 0);
  await interrupted.close();

  const printed = execFileSync(program, ["replay", link], { cwd: root, encoding: "utf8" }).trim().split("\n");
  assert.deepEqual(printed, [headline, hash]);
  // A link of another scene or policy shows a warning.
  for (const [field, code] of [["sc", "link_scene_mismatch"], ["mh", "link_model_mismatch"], ["h", "link_result_mismatch"]]) {
    const { page: elsewhere } = await newPage(served);
    await elsewhere.goto(link.replace(new RegExp(`&${field}=[0-9a-f]{4}`), `&${field}=0000`));
    await elsewhere.waitForSelector(`[data-code=${code}]`);
    await elsewhere.close();
  }
  // A link with camera and tick; a policy selected afterwards is kept.
  const { page: withTick } = await newPage(served);
  await withTick.goto(link.replace("&h=", "&c=0.600,-2.000,1.000,0.600,0.000,0.100&t=30&h="));
  // The attempt passes that tick once before it ends.
  await withTick.waitForFunction(() => document.getElementById("hash").textContent.endsWith("(matches the link)"));
  await withTick.waitForFunction(() => document.getElementById("timeline").value === "30");
  await withTick.focus("#policy");
  await withTick.waitForSelector("#policy [value=mlp-pcd]", { state: "attached" });
  await withTick.selectOption("#policy", "mlp-pcd");
  await withTick.waitForFunction(() => document.getElementById("model").textContent === "Loaded: mlp-pcd");
  await withTick.reload();
  await untilReady(withTick);
  assert.equal(await withTick.textContent("#model"), "Loaded: mlp-pcd");
  await withTick.close();
  const damaged = await newPage(served);
  await damaged.page.goto(link.replace(/&h=.*/, ""));
  await damaged.page.waitForSelector("[data-code=invalid_link]");
  await damaged.page.close();
});

test("share link of a mesh file requests the file and rejects another one", async () => {
  const context = await served.browser.newContext({ permissions: ["clipboard-read", "clipboard-write"], reducedMotion: "reduce" });
  const page = await context.newPage();
  await page.goto(served.address);
  await untilReady(page);
  await page.setInputFiles("#file", cube(0.06));
  await page.waitForSelector("#objects [value='file:cube.obj']:checked");
  const { hash } = await grasp(page, 1);
  await page.click("#copy-link");
  await page.waitForFunction(() => document.getElementById("share-hint").textContent.startsWith("Copied"));
  const link = await page.evaluate(() => navigator.clipboard.readText());
  await context.close();
  const { page: other } = await newPage(served);
  await other.goto(link);
  await other.waitForSelector("[data-code=link_needs_file]");
  await untilReady(other);
  await other.setInputFiles("#file", cube(0.07));
  await other.waitForSelector("[data-code=link_object_mismatch]");
  await other.setInputFiles("#file", cube(0.06));
  await other.waitForFunction(() => document.getElementById("hash").textContent.endsWith("(matches the link)"));
  assert.equal(await other.getAttribute("#hash", "title"), hash);
  assert.equal(await other.locator(".failure").count(), 0);
  await other.close();
});

test("ngf replay follows a share link of a mesh file with its import options", async (t) => {
  const context = await served.browser.newContext({ permissions: ["clipboard-read", "clipboard-write"], reducedMotion: "reduce" });
  const page = await context.newPage();
  await page.goto(served.address);
  await untilReady(page);
  const folder = mkdtempSync(join(tmpdir(), "link-"));
  t.after(() => rmSync(folder, { recursive: true }));
  const file = join(folder, "box.obj");
  writeFileSync(file, BOX);
  await page.setInputFiles("#file", file);
  await page.waitForSelector("#objects [value='file:box.obj']:checked");
  const links = [];
  const share = async () => {
    const { headline, hash } = await grasp(page, 3);
    await page.click("#copy-link");
    await page.waitForFunction(() => document.getElementById("share-hint").textContent.startsWith("Copied"));
    links.push({ link: await page.evaluate(() => navigator.clipboard.readText()), headline, hash });
  };
  await share();
  await page.fill("#mass", "250");
  await page.press("#mass", "Tab");
  await page.waitForFunction(() => document.getElementById("info-mass").textContent === "250 g");
  await page.selectOption("#orientation", "0");
  await page.waitForFunction(() => document.getElementById("info-size").textContent.endsWith("× 4.0 cm"));
  await share();
  await context.close();
  for (const { link, headline, hash } of links) {
    const printed = execFileSync(program, ["replay", link, "--mesh", file], { cwd: root, encoding: "utf8" }).trim().split("\n");
    assert.deepEqual(printed, [headline, hash]);
  }
  assert.notEqual(links[0].hash, links[1].hash);
});
