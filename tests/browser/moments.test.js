// An attempt looked at again, in numbers, in a row with others, and by whoever gets a link to it.

import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { barriers, blank, grasp, open, program, restart, root, screenshot, untilReady, visit } from "./chromium.js";
import { BOX } from "./meshes.js";

let served;
before(async () => (served = await open()));
after(() => served?.close());

function cube(side) {
  const corners = [0, 1, 2, 3, 4, 5, 6, 7].map((k) => `v ${[k & 1, (k >> 1) & 1, (k >> 2) & 1].map((bit) => bit * side).join(" ")}`);
  const faces = ["1 3 4 2", "5 6 8 7", "1 2 6 5", "3 7 8 4", "1 5 7 3", "2 4 8 6"].map((face) => `f ${face}`);
  return { name: "cube.obj", mimeType: "model/obj", buffer: Buffer.from([...corners, ...faces].join("\n")) };
}

test("the slider shows any moment again, and playing goes on from there", async () => {
  const { page, complaints } = await visit(served);
  await untilReady(page);
  const { words } = await grasp(page, 0);
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
  await page.waitForSelector("[data-phase=verdict].is-now");
  assert.equal(await page.textContent("#headline"), words, "what it came to is said again");
  assert.equal(await page.textContent("#tally"), "1 of 1 lifted", "looking again counts nothing");
  assert.deepEqual(complaints, []);
  await page.close();
});

test("what goes on inside is shown for every joint and over time", async () => {
  const { page } = await visit(served);
  await untilReady(page);
  const lines = () => page.$$eval("#plots polyline", (lines) => lines.map((line) => line.getAttribute("points")));
  await page.click("#inside summary");
  await grasp(page, 0);
  assert.equal(await page.locator(".joint").count(), 23);
  // Energy, four terms of the fabric, damping, margin; in the end every tick is there, however fast it went.
  const ticks = Number(await page.getAttribute("#timeline", "max")) + 1;
  await page.waitForFunction((ticks) => document.querySelector("#plots polyline").getAttribute("points").split(" ").length === ticks, ticks);
  const watched = await lines();
  assert.equal(watched.length, 7);
  assert.ok(watched.every((points) => points.split(" ").length > 30), String(watched));
  // Whoever looks only afterwards sees the same.
  await page.click("#inside summary");
  await page.click("#new-pose");
  await grasp(page, 0);
  await page.click("#inside summary");
  await page.waitForFunction((wanted) => document.querySelector("#plots polyline").getAttribute("points") === wanted, watched[0]);
  assert.deepEqual(await lines(), watched);
  await page.locator("#inside").scrollIntoViewIfNeeded();
  await screenshot(page, "inside");
  await page.close();
});

test("another policy is chosen, and the page comes back with it", async () => {
  const { page, complaints } = await visit(served);
  await untilReady(page);
  const acts = (id) => page.waitForFunction((id) => document.getElementById("model").textContent.startsWith(`Policy "${id}"`), id);
  await acts("default");
  await page.focus("#policy");
  await page.waitForSelector("#policy [value=mlp-pcd]", { state: "attached" });
  await page.selectOption("#policy", "mlp-pcd");
  await acts("mlp-pcd");
  assert.equal(new URL(page.url()).search, "?model=mlp-pcd");
  await grasp(page, 0);
  assert.match(await page.textContent("#hash"), /^Seed 0 /);
  await page.reload();
  await untilReady(page);
  await acts("mlp-pcd");
  assert.equal(await page.inputValue("#policy"), "mlp-pcd");
  await page.locator("#policy").scrollIntoViewIfNeeded();
  await screenshot(page, "policy");
  // One that is gone since the list was made: the one before still acts, and there is a link to what it did.
  await grasp(page, 0);
  await page.focus("#policy");
  await page.waitForSelector("#policy [value=paper]", { state: "attached" });
  await page.route("**/models/paper/**", (route) => route.fulfill({ status: 404 }));
  await page.selectOption("#policy", "paper");
  await page.waitForSelector(".failures [data-code]");
  await page.waitForFunction(() => document.getElementById("policy").value === "mlp-pcd");
  assert.ok(await page.isEnabled("#copy-link"));
  // Another worker is told of the one that acts, not of the one that did not come.
  await restart(page);
  await acts("mlp-pcd");
  await page.selectOption("#policy", "default");
  await acts("default");
  assert.equal(new URL(page.url()).search, "");
  // What is gone shows in the console.
  assert.ok(complaints.every((complaint) => /404|paper|stopped by a test/.test(complaint)), complaints.join());
  await page.close();
});

test("a second policy beside the first is given the same, and layers are drawn", async () => {
  const { page, complaints } = await visit(served);
  await untilReady(page);
  await page.click("#objects label:has([value=soup_can])");
  await page.click("#new-pose");
  await page.selectOption("#compare", "default");
  await page.waitForSelector("#view-2", { state: "visible" });
  await page.keyboard.press("t");
  await grasp(page, 4);
  await page.waitForFunction(() => /^default: /.test(document.getElementById("who-2").textContent));
  assert.equal(await page.textContent("#who-1"), await page.textContent("#who-2"), "the same policy comes to the same");
  await page.click("#phases [data-phase=lift] button");
  await screenshot(page, "comparison");
  await page.click("#new-pose");
  for (const who of ["#who-1", "#who-2"]) assert.equal(await page.textContent(who), "default", "what an attempt came to goes with it");
  await page.selectOption("#compare", "");
  await page.waitForSelector("#view-2", { state: "hidden" });
  // Asked for before the second policy is there, an attempt waits for it, and is not the planner's.
  await page.focus("#compare");
  await page.waitForSelector("#compare [value=mlp-pcd]", { state: "attached" });
  await page.selectOption("#compare", "mlp-pcd");
  assert.equal(await page.textContent("#who-2"), "mlp-pcd: loading");
  await page.click("#grasp");
  await page.waitForFunction(() => /^mlp-pcd: [A-Z]/.test(document.getElementById("who-2").textContent));
  assert.equal(await page.locator(".failures [data-code]").count(), 0);
  await page.selectOption("#compare", "");
  await page.waitForSelector("#view-2", { state: "hidden" });
  assert.deepEqual(complaints, []);
  // The second worker stops: the first is not to be restarted.
  const [second] = await Promise.all([page.waitForEvent("worker"), page.selectOption("#compare", "default")]);
  await second.evaluate(() => {
    setTimeout(() => {
      throw new Error("stopped by a test");
    });
  });
  await page.waitForSelector("[data-code=second_engine_stopped]");
  assert.ok(await page.isHidden("[data-code=second_engine_stopped] .again"));
  await page.waitForSelector("#view-2", { state: "hidden" });
  assert.ok(await page.isEnabled("#grasp"));
  await page.close();
});

test("twenty attempts in a row are counted, and end as one by one", async () => {
  const { page } = await visit(served);
  await untilReady(page);
  await page.fill("#seed", "100");
  await page.press("#seed", "Enter");
  await page.click("#batch-run");
  await page.waitForFunction(() => document.getElementById("batch-run").textContent === "Run" && document.getElementById("batch-words").textContent.includes("of 20"));
  const [download] = await Promise.all([page.waitForEvent("download"), page.click("#batch-csv")]);
  const rows = readFileSync(await download.path(), "utf8").trim().split("\n").slice(1);
  assert.equal(rows.length, 20);
  const [name, seed, , , , lifted] = rows[3].split(",");
  assert.equal(name, "default");
  const { words, hash } = await grasp(page, Number(seed));
  assert.ok(rows[3].endsWith(hash), `${rows[3]} and ${hash}`);
  assert.equal(words === "Lifted and held.", lifted === "true");
  assert.match(await page.textContent("#tally"), /of 20 lifted/, "the same attempt counts once");
  // Where they stood: a mark each, and a click shows that attempt again.
  const lifts = rows.filter((row) => row.split(",")[5] === "true").length;
  assert.equal(await page.locator("#places-map .is-lifted").count(), lifts);
  assert.equal(await page.locator("#places-map .is-failed").count(), 20 - lifts);
  assert.equal(await page.locator("#batch-failures li").count(), 20 - lifts);
  await page.locator("#places-map g").nth(5).click();
  await page.waitForFunction(() => document.getElementById("seed").value === "105");
  // The same as a table, by keyboard.
  await page.focus("#attempts-all summary");
  await page.keyboard.press("Enter");
  assert.equal(await page.locator("#attempts-rows tr").count(), 20);
  assert.equal(await page.locator("#attempts-rows .is-failed").count(), 20 - lifts);
  await page.focus("#attempts-rows button[aria-label='Watch seed 107']");
  await screenshot(page, "batch-table");
  assert.deepEqual(await barriers(page), []);
  await page.keyboard.press("Enter");
  await page.waitForFunction(() => document.getElementById("seed").value === "107");
  // Another row can be stopped.
  await page.selectOption("#batch-count", "100");
  await page.click("#batch-run");
  await page.waitForFunction(() => /of/.test(document.getElementById("batch-words").textContent));
  await page.click("#batch-run");
  await page.waitForFunction(() => document.getElementById("batch-run").textContent === "Run");
  await screenshot(page, "batch");
  await page.close();
});

test("two policies are counted on the same seeds", async () => {
  const { page, complaints } = await visit(served);
  await untilReady(page);
  await page.focus("#compare");
  await page.waitForSelector("#compare [value=mlp-pcd]", { state: "attached" });
  await page.selectOption("#compare", "mlp-pcd");
  await page.waitForFunction(() => document.getElementById("who-2").textContent === "mlp-pcd");
  await page.click("#batch-run");
  await page.waitForFunction(() => document.getElementById("batch-run").textContent === "Run");
  assert.match(await page.textContent("#batch-words"), /^\d+ of 20$/);
  const beside = await page.textContent("#batch-beside");
  assert.match(beside, /^default: \d+ of 20 \([\d.]+ % to \d+ %\), mlp-pcd: \d+ of 20 \([\d.]+ % to \d+ %\)\. Of the 20 that both tried, default alone lifted \d+, mlp-pcd alone \d+\.$/);
  const [download] = await Promise.all([page.waitForEvent("download"), page.click("#batch-csv")]);
  const rows = readFileSync(await download.path(), "utf8").trim().split("\n").slice(1).map((line) => line.split(","));
  const lifted = (name) => rows.filter((row) => row[0] === name).map((row) => row[5] === "true");
  const [first, second] = [lifted("default"), lifted("mlp-pcd")];
  assert.deepEqual([first.length, second.length], [20, 20]);
  const alone = (one, other) => one.filter((lifts, seed) => lifts && !other[seed]).length;
  assert.deepEqual(beside.match(/\d+/g).slice(-2).map(Number), [alone(first, second), alone(second, first)]);
  await screenshot(page, "batch-of-two");
  // Another object ends the row of both, and the next one counts nothing of it.
  await page.click("#batch-run");
  await page.waitForFunction(() => /mlp-pcd: [12] of/.test(document.getElementById("batch-beside").textContent));
  await page.click("#objects label:has([value=soup_can])");
  await page.waitForFunction(() => document.getElementById("batch-words").textContent === "");
  assert.equal(await page.textContent("#batch-run"), "Run");
  await page.click("#batch-run");
  await page.waitForFunction(() => document.getElementById("batch-run").textContent === "Run");
  assert.match(await page.textContent("#batch-beside"), /^default: \d+ of 20 \(.*\), mlp-pcd: \d+ of 20 \(.*\)\. Of the 20 /);
  // What ends the second ends its share of the row.
  await page.click("#batch-run");
  await page.waitForFunction(() => /mlp-pcd: [12] of/.test(document.getElementById("batch-beside").textContent));
  await page.selectOption("#compare", "");
  await page.waitForFunction(() => document.getElementById("batch-run").textContent === "Run");
  assert.match(await page.textContent("#batch-words"), /^\d+ of 20$/);
  assert.deepEqual(complaints, []);
  await page.close();
});

test("any mesh gets an answer without a policy: a grasp is searched in physics and played", async () => {
  const { page, complaints } = await visit(served);
  await untilReady(page);
  await page.setInputFiles("#file", cube(0.06));
  await page.waitForSelector("#objects [value='file:cube.obj']:checked");
  // It can be stopped, and the scene goes on meanwhile.
  await page.click("#search");
  await page.click("#new-pose");
  await page.click("#search");
  await page.waitForFunction(() => document.getElementById("search-words").textContent === "Stopped.");
  await page.click("#search");
  await page.waitForFunction(() => /lift it reliably/.test(document.getElementById("search-words").textContent));
  await page.selectOption("#speed", "4");
  await page.waitForSelector("[data-phase=verdict].is-now");
  assert.equal(await page.textContent("#headline"), "Lifted and held.");
  assert.match(await page.textContent("#hash"), /^Grasp searched for cube\.obj ended in state/);
  assert.match(await page.textContent("#share-hint"), /only repeat what a policy does/);
  assert.equal(await page.textContent("#tally"), "None yet with this object");
  await screenshot(page, "search");
  assert.deepEqual(complaints, []);
  await page.close();
});

// The link to the first attempt from a seed on that lifts the object, or does not, and how that ended.
async function linkTo(object, lifts, seed) {
  const context = await served.browser.newContext({ permissions: ["clipboard-read", "clipboard-write"], reducedMotion: "reduce" });
  const page = await context.newPage();
  await page.goto(served.address);
  await untilReady(page);
  await page.click(`#objects label:has([value=${object}])`);
  await page.waitForSelector(`#objects [value=${object}]:checked`);
  let end = await grasp(page, seed);
  for (let next = seed + 1; (end.words === "Lifted and held.") !== lifts; next += 1) {
    assert.ok(next < seed + 50, `of 50 attempts none ${lifts ? "lifts" : "fails"}`);
    end = await grasp(page, next);
  }
  await page.click("#copy-link");
  await page.waitForFunction(() => document.getElementById("share-hint").textContent === "Copied.");
  const link = await page.evaluate(() => navigator.clipboard.readText());
  await context.close();
  return { ...end, link };
}

test("a failure's link fails alike, here and on the command line", async () => {
  const { words, hash, link } = await linkTo("cracker_box", false, 0);
  const { page, complaints } = await blank(served);
  await page.goto(link);
  await page.waitForFunction(() => document.getElementById("hash").textContent.endsWith("as in the link"));
  assert.deepEqual([await page.textContent("#headline"), await page.getAttribute("#hash", "title")], [words, hash]);
  assert.deepEqual(complaints, []);
  await page.close();
  const told = execFileSync(program, ["replay", link], { cwd: root, encoding: "utf8" }).trim().split("\n");
  assert.deepEqual(told, [words, hash]);
});

test("whoever gets the link sees the same, here and on the command line", async () => {
  const { words, hash, link } = await linkTo("sugar_box", true, 5);

  const { page: other, complaints } = await blank(served);
  await other.goto(link);
  await other.waitForFunction(() => document.getElementById("hash").textContent.endsWith("as in the link"));
  assert.equal(await other.getAttribute("#hash", "title"), hash);
  assert.equal(await other.textContent("#headline"), words);
  assert.deepEqual(complaints, []);
  await other.close();

  // The same where the demo is open already.
  const { page: tab } = await visit(served);
  await untilReady(tab);
  await tab.evaluate((link) => (location.href = link), link);
  await tab.waitForFunction(() => document.getElementById("hash")?.textContent.endsWith("as in the link"));
  assert.equal(await tab.getAttribute("#hash", "title"), hash);
  await tab.close();

  // Whoever takes over makes an attempt that the link says nothing of.
  const { page: taken } = await blank(served);
  await taken.goto(link);
  await taken.waitForSelector("#phases .is-now");
  await grasp(taken, 6);
  assert.ok(!(await taken.textContent("#hash")).includes("as in the link"));
  assert.equal(await taken.locator("[data-code=link_other_end]").count(), 0);
  await taken.close();

  const told = execFileSync(program, ["replay", link], { cwd: root, encoding: "utf8" }).trim().split("\n");
  assert.deepEqual(told, [words, hash]);
  // From another scene or policy it may end otherwise, and that is said.
  for (const [field, code] of [["sc", "link_other_scene"], ["mh", "link_other_model"], ["h", "link_other_end"]]) {
    const { page: elsewhere } = await blank(served);
    await elsewhere.goto(link.replace(new RegExp(`&${field}=[0-9a-f]{4}`), `&${field}=0000`));
    await elsewhere.waitForSelector(`[data-code=${code}]`);
    await elsewhere.close();
  }
  // Its camera, its moment, and another policy once one is chosen, which stays.
  const { page: moment } = await blank(served);
  await moment.goto(link.replace("&h=", "&c=0.600,-2.000,1.000,0.600,0.000,0.100&t=30&h="));
  // It comes past that moment a first time while it is made.
  await moment.waitForFunction(() => document.getElementById("hash").textContent.endsWith("as in the link"));
  await moment.waitForFunction(() => document.getElementById("timeline").value === "30");
  await moment.focus("#policy");
  await moment.waitForSelector("#policy [value=mlp-pcd]", { state: "attached" });
  await moment.selectOption("#policy", "mlp-pcd");
  await moment.waitForFunction(() => document.getElementById("model").textContent === 'Policy "mlp-pcd" acts.');
  await moment.reload();
  await untilReady(moment);
  assert.equal(await moment.textContent("#model"), 'Policy "mlp-pcd" acts.');
  await moment.close();
  const damaged = await blank(served);
  await damaged.page.goto(link.replace(/&h=.*/, ""));
  await damaged.page.waitForSelector("[data-code=link_damaged]");
  await damaged.page.close();
});

test("a link about a file asks for it, and takes no other", async () => {
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
  const { page: other } = await blank(served);
  await other.goto(link);
  await other.waitForSelector("[data-code=link_needs_file]");
  await untilReady(other);
  await other.setInputFiles("#file", cube(0.07));
  await other.waitForSelector("[data-code=link_other_object]");
  await other.setInputFiles("#file", cube(0.06));
  await other.waitForFunction(() => document.getElementById("hash").textContent.endsWith("as in the link"));
  assert.equal(await other.getAttribute("#hash", "title"), hash);
  assert.equal(await other.locator(".failure").count(), 0);
  await other.close();
});

test("a link about a file is followed on the command line, with all that was said of the file", async (t) => {
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
    const { words, hash } = await grasp(page, 3);
    await page.click("#copy-link");
    await page.waitForFunction(() => document.getElementById("share-hint").textContent.startsWith("Copied"));
    links.push({ link: await page.evaluate(() => navigator.clipboard.readText()), words, hash });
  };
  await share();
  await page.fill("#mass", "250");
  await page.press("#mass", "Tab");
  await page.waitForFunction(() => document.getElementById("report-mass").textContent === "250 g");
  await page.selectOption("#sides", "0");
  await page.waitForFunction(() => document.getElementById("report-size").textContent.endsWith("× 4.0 cm"));
  await share();
  await context.close();
  for (const { link, words, hash } of links) {
    const told = execFileSync(program, ["replay", link, "--mesh", file], { cwd: root, encoding: "utf8" }).trim().split("\n");
    assert.deepEqual(told, [words, hash]);
  }
  assert.notEqual(links[0].hash, links[1].hash);
});
