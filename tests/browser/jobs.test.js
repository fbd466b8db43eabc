// The jobs page: from a form to a policy that is tried in the demo.

import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { barriers, blank, PATIENCE, PHONE, screenshot, untilReady } from "./chromium.js";
import { openJobs, stands, until } from "./jobs.js";
import { bottle } from "./meshes.js";

let jobs;
before(async () => (jobs = await openJobs()));
after(() => jobs?.close());

test("a dataset is asked for with the form, watched, and one of its demonstrations played", async () => {
  const { page, complaints } = await jobs.visit();
  await page.click("text=New job");
  await page.selectOption("[data-param=preset] select", "smoke");
  await page.fill("[data-param=seed] input", "-1");
  // What the server refuses is marked where it stands.
  await page.waitForSelector("[data-param=seed] [aria-invalid=true]");
  await page.waitForSelector(".new-job .failure");
  await page.fill("[data-param=seed] input", "5");
  await page.waitForSelector(".new-job .failure", { state: "detached" });
  await page.waitForFunction(() => /It takes about/.test(document.querySelector(".estimate").textContent));
  await page.fill(".line:has-text('Name') >> nth=0 >> input", "Asked for by hand");
  await screenshot(page, "jobs-new");
  await page.click("button:has-text('Begin')");
  await stands(page, "succeeded");
  assert.equal(await page.textContent("h1"), "Asked for by hand");
  assert.match(await page.textContent(".row a"), /Asked for by hand.*done/);
  await page.waitForFunction(() => document.querySelector(".log").textContent.includes("sugar"));
  await page.click("a:has-text('ds_')");
  await page.waitForSelector("td:has-text('Sugar box')");
  await screenshot(page, "jobs-dataset");
  const [demo] = await Promise.all([page.context().waitForEvent("page"), page.click("a:has-text('Play')")]);
  await demo.waitForFunction(() => /^Demonstration: episode 0, sugar box/.test(document.getElementById("hash").textContent));
  await demo.close();
  // A refusal is an answer, and the browser's own list of them is no complaint.
  assert.deepEqual(complaints.filter((text) => !text.includes("422")), []);
  await page.close();
});

test("a training is watched, stopped, gone on with, compared, and tried in the demo while it runs", async () => {
  const { outputs } = await jobs.made("dataset.generate", { preset: "smoke" });
  const { dataset_id } = outputs;
  const encoder = await jobs.made("encoder.train", { dataset_id, steps: 50, checkpoint: 50 }, "First encoder");
  const other = await jobs.made("encoder.train", { dataset_id, steps: 50, checkpoint: 50, rate: 0.01 }, "Other encoder");
  // What only sees does not act.
  const blind = { kind: "policy.evaluate", params: { model_id: encoder.outputs.model_id, object: "sugar_box" } };
  const refused = await fetch(`${jobs.served.address}/api/v1/jobs?dry_run=true`, { method: "POST", body: JSON.stringify(blind) });
  assert.match((await refused.json()).detail, /is an encoder, which does not act/);
  const params = { dataset_id, encoder_id: encoder.outputs.model_id, steps: 100_000, batch: 8, checkpoint: 100 };
  const { id } = await jobs.api("jobs", { kind: "policy.train", params, name: "A long one" });

  const { page, complaints } = await jobs.visit(`#jobs/${id}`);
  await stands(page, "running");
  await page.waitForSelector(".chart canvas");
  await page.waitForSelector("a:has-text('Try in demo')");
  const [demo] = await Promise.all([
    page.context().waitForEvent("page"),
    page.click("a:has-text('Try in demo')"),
  ]);
  await demo.emulateMedia({ reducedMotion: "no-preference" });
  await demo.reload();
  const acts = () => demo.textContent("#model");
  await demo.waitForFunction(() => /Policy "mdl_\w+" acts/.test(document.getElementById("model").textContent));
  await screenshot(page, "jobs-training");
  // What it has learned since acts next, until another policy is chosen.
  const first = await acts();
  await demo.bringToFront();
  await untilReady(demo);
  await demo.keyboard.press("r");
  await demo.waitForSelector("#training-words:has-text('the newest so far')");
  await demo.waitForFunction((first) => document.getElementById("model").textContent !== first, first);
  assert.match(await acts(), /Policy "mdl_\w+" acts/);
  // Nobody has pressed anything: it tries by itself what the one before it has tried.
  await demo.waitForSelector("#phases .is-now");
  await demo.locator("#training").scrollIntoViewIfNeeded();
  await screenshot(demo, "demo-training");
  await demo.selectOption("#policy", "default");
  await demo.waitForFunction(() => document.getElementById("model").textContent === 'Policy "default" acts.');
  assert.equal(await demo.isChecked("#training-follow"), false);
  // Two more are written, and it is still there.
  for (let k = 0; k < 2; k += 1) {
    const newest = await demo.textContent("#training-words");
    await demo.waitForFunction((newest) => document.getElementById("training-words").textContent !== newest, newest);
  }
  assert.equal(await acts(), 'Policy "default" acts.');
  await demo.reload();
  await untilReady(demo);
  assert.equal(await acts(), 'Policy "default" acts.');
  assert.ok(await demo.isHidden("#training"));
  await demo.close();
  // By keyboard one goes on from where one was, though the buttons are others.
  const focused = (words) => page.waitForFunction((words) => document.activeElement.textContent === words, words);
  await page.focus("button:has-text('Pause')");
  await page.keyboard.press("Enter");
  await stands(page, "paused");
  await focused("Resume");
  await page.keyboard.press("Enter");
  await stands(page, "running");
  await focused("Pause");
  await page.click("button:has-text('Stop')");
  await stands(page, "cancelled");

  await page.check("[aria-label='Compare First encoder']");
  await page.check("[aria-label='Compare Other encoder']");
  await page.waitForSelector("h1:has-text('Comparison')");
  assert.match(await page.textContent(".detail table"), /rate.*0\.01/);
  await page.waitForSelector(".chart canvas");
  await screenshot(page, "jobs-comparison");

  await page.goto(`${jobs.served.address}/jobs/#jobs/${other.id}`);
  await page.click("button:has-text('Delete')");
  await page.click("button:has-text('Undo')");
  assert.equal((await jobs.api(`jobs/${other.id}`)).id, other.id);
  await page.click("button:has-text('Delete')");
  await page.waitForFunction((id) => !document.querySelector(`[data-id=${id}]`), other.id);
  assert.equal((await fetch(`${jobs.served.address}/api/v1/jobs/${other.id}`)).status, 404);
  assert.deepEqual(complaints, []);
  await page.close();
});

test("charts are zoomed and moved together, by step and by its logarithm", async () => {
  const { outputs } = await jobs.made("dataset.generate", { preset: "smoke" });
  const { id } = await jobs.made("encoder.train", { dataset_id: outputs.dataset_id, steps: 400, checkpoint: 400 });
  const { page, complaints } = await jobs.visit(`#jobs/${id}`);
  const over = page.locator(".chart .u-over");
  await over.nth(1).waitFor();
  await over.nth(0).scrollIntoViewIfNeeded();
  const box = await over.nth(0).boundingBox();
  const to = (share) => page.mouse.move(box.x + share * box.width, box.y + box.height / 2, { steps: 4 });
  const dragged = async (from, until, button = "left") => (await to(from), await page.mouse.down({ button }), await to(until), await page.mouse.up({ button }));
  // The steps that stand in the middle of the first two charts.
  const middle = async () => {
    await to(0.5);
    const told = (chart) => page.locator(".chart").nth(chart).locator(".u-value").first().textContent();
    return Promise.all([0, 1].map(async (chart) => Number((await told(chart)).replaceAll(",", ""))));
  };
  const beginsAnew = () => page.mouse.dblclick(box.x + box.width / 2, box.y + box.height / 2);
  for (const isLog of [false, true]) {
    await page.getByLabel("log x").setChecked(isLog);
    const whole = await middle();
    await dragged(0.3, 0.7);
    const zoomed = await middle();
    await page.keyboard.down("Shift");
    await dragged(0.9, 0.1);
    await page.keyboard.up("Shift");
    const moved = await middle();
    assert.ok(moved.every((step, chart) => step > zoomed[chart]), `${moved} after ${zoomed}, log x: ${isLog}`);
    // What was moved back stands where it stood.
    await page.keyboard.down("Shift");
    await dragged(0.1, 0.9);
    await page.keyboard.up("Shift");
    assert.deepEqual(await middle(), zoomed, `log x: ${isLog}`);
    // Another button does neither.
    await dragged(0.2, 0.4, "right");
    assert.deepEqual(await middle(), zoomed, `log x: ${isLog}`);
    await beginsAnew();
    assert.deepEqual(await middle(), whole, `log x: ${isLog}`);
  }
  assert.deepEqual(complaints, []);
  await page.close();
});

test("an evaluation shows its table, and the model knows of it", async () => {
  const params = { model_id: "default", object: "sugar_box", attempts: 2 };
  const { id } = await jobs.made("policy.evaluate", params, "Two attempts");
  const { page, complaints } = await jobs.visit(`#jobs/${id}`);
  await page.waitForSelector("td:has-text('of 2')");
  // Whoever follows a row by keyboard goes on with the job, not with the rows after it.
  await page.goto(`${jobs.served.address}/jobs/#jobs`);
  await page.focus("#list a:has-text('Two attempts')");
  await page.keyboard.press("Enter");
  await page.waitForFunction(() => document.activeElement.id === "detail");
  await page.waitForSelector("td:has-text('of 2')");
  await page.click("a:has-text('default')");
  await page.waitForSelector("td:has-text('of 2')");
  await screenshot(page, "jobs-model");
  assert.deepEqual(complaints, []);
  await page.close();
});

test("an attempt that failed in an evaluation is made again in the demo, and ends there in the same state", async () => {
  // A bottle that lies, because it is drawn with y up, and that is too heavy for a hand.
  const { id: mesh_id } = await jobs.uploaded("bottle.obj", bottle(4000).replaceAll(/v (\S+) (\S+) (\S+)/g, "v $1 $3 $2"));
  const params = { model_id: "default", mesh_id, mass_kg: 6, attempts: 2, seed: 3 };
  const { id } = await jobs.made("policy.evaluate", params, "A bottle of lead");
  const { page, complaints } = await jobs.visit(`#jobs/${id}`);
  await page.waitForSelector("td:has-text('bottle.obj')");
  await page.click(".attempts summary");
  await screenshot(page, "jobs-attempts");
  const [demo] = await Promise.all([page.context().waitForEvent("page"), page.click("a:has-text('seed 4')")]);
  await demo.waitForSelector("#hash:has-text('as in the link')", { timeout: PATIENCE });
  assert.equal(await demo.locator("#failures article").count(), 0);
  assert.deepEqual(complaints, []);
  await demo.close();
  await page.close();
  await fetch(`${jobs.served.address}/api/v1/meshes/${mesh_id}`, { method: "DELETE" });
});

test("a mesh is uploaded, evaluated on by a link, tried in the demo, and deleted", async () => {
  const { page, complaints } = await jobs.visit("#meshes");
  const cube = ["v 0 0 0", "v 8 0 0", "v 8 8 0", "v 0 8 0", "v 0 0 8", "v 8 0 8", "v 8 8 8", "v 0 8 8"];
  const faces = ["1 4 3 2", "5 6 7 8", "1 2 6 5", "2 3 7 6", "3 4 8 7", "4 1 5 8"].map((face) => `f ${face}`);
  const buffer = Buffer.from([...cube, ...faces].join("\n"));
  await page.setInputFiles("input[type=file]", { name: "cube.obj", mimeType: "model/obj", buffer });
  await page.waitForSelector("td:has-text('8.0 × 8.0 × 8.0 cm')");
  const [demo] = await Promise.all([page.context().waitForEvent("page"), page.click("a:has-text('Try in demo')")]);
  await demo.waitForSelector("#objects [value='file:cube.obj']:checked");
  await demo.close();
  await page.setInputFiles("input[type=file]", { name: "bad.obj", mimeType: "model/obj", buffer: Buffer.from("v 1") });
  await page.waitForSelector(".failure");
  await page.click("button:has-text('Delete')");
  await page.waitForSelector("text=None yet.");
  assert.deepEqual(complaints.filter((text) => !text.includes("422")), []);
  await page.close();
});

test("a filter holds while a job runs", async () => {
  const { page, complaints } = await jobs.visit();
  await page.waitForSelector("[data-state=live]");
  await page.selectOption("#filter-status", { label: "failed" });
  const { id } = await jobs.long();
  const row = `[data-id=${id}]`;
  // What is chosen is shown, and yet not listed.
  await page.evaluate((id) => (location.hash = `#jobs/${id}`), id);
  await stands(page, "running");
  assert.equal(await page.$(row), null);
  await page.selectOption("#filter-status", { label: "not over" });
  await page.waitForSelector(row);
  await page.click("button:has-text('Stop')");
  await stands(page, "cancelled");
  await page.waitForSelector(row, { state: "detached" });
  await page.selectOption("#filter-status", { label: "any status" });
  await page.waitForSelector(`${row}:has-text('stopped')`);
  assert.deepEqual(complaints, []);
  await page.close();
});

test("what was stopped is tried again, and asked for again with changes", async () => {
  const { id } = await jobs.long({ seed: 7 }, "Tried");
  await jobs.stop(id);
  const { page, complaints } = await jobs.visit(`#jobs/${id}`);
  // It goes on if it had begun.
  await page.click("button:has-text('Try again'), button:has-text('Go on')");
  await stands(page, "running");
  await page.click("button:has-text('Stop')");
  await stands(page, "cancelled");
  await page.click("text=Again with changes");
  await page.waitForSelector("[data-param=seed] input");
  assert.equal(await page.inputValue("[data-param=seed] input"), "7");
  await page.fill("[data-param=seed] input", "8");
  await page.click("button:has-text('Begin')");
  await page.waitForSelector("h1:has-text('Tried, changed')");
  const copy = await jobs.stop(new URL(page.url()).hash.split("/")[1]);
  assert.notEqual(copy.id, id);
  const { seed, object, model_id } = copy.params;
  assert.deepEqual({ seed, object, model_id }, { seed: 8, object: "sugar_box", model_id: "planner" });
  assert.deepEqual(complaints, []);
  await page.close();
});

test("a thousand jobs scroll", async () => {
  const ids = [];
  for (let k = 0; k < 1000; k++) {
    // The hundred that may wait are soon full of what nobody wants.
    const { id } = await jobs.api("jobs", { kind: "policy.evaluate", params: { model_id: "planner", object: "sugar_box" } });
    await jobs.api(`jobs/${id}/cancel`, {});
    ids.push(id);
  }
  const { page } = await jobs.visit();
  const oldest = `[data-id=${ids[0]}]`;
  // Whoever holds the key is at the end again before a picture was drawn.
  await page.evaluate(() => {
    const toEnd = () => document.getElementById("rail").scrollTo(0, 1e9);
    new MutationObserver(toEnd).observe(document.getElementById("list"), { childList: true });
    toEnd();
  });
  await page.waitForSelector(oldest);
  const began = Date.now();
  await page.click(`${oldest} a`);
  await stands(page, "cancelled");
  assert.ok(Date.now() - began < 3000, `${Date.now() - began} ms`);
  await page.close();
});

// Views of which there are pictures, too.
const PICTURED = ["demo", "job", "new-job", "models", "api"];

for (const colorScheme of ["light", "dark"]) {
  test(`nothing bars anybody from the pages, ${colorScheme}`, async () => {
    const { data: trainings } = await jobs.api("jobs?limit=1&kind=policy.train");
    const { data: datasets } = await jobs.api("datasets?limit=1");
    await jobs.uploaded();
    for (const [name, path, there] of [
      ["demo", "/", "#grasp:enabled"],
      ["jobs", "/jobs/", ".row"],
      ["job", `/jobs/#jobs/${trainings[0].id}`, ".log"],
      ["new-job", "/jobs/#new", "[data-param=preset]"],
      ["datasets", "/jobs/#datasets", "td"],
      ["dataset", `/jobs/#datasets/${datasets[0].id}`, "a:has-text('Play')"],
      ["models", "/jobs/#models", "td"],
      ["model", "/jobs/#models/default", ".facts"],
      ["meshes", "/jobs/#meshes", "td"],
      ["api", "/docs/", ".request"],
    ]) {
      const { page, complaints } = await blank(jobs.served, { colorScheme });
      const picture = async (suffix) => PICTURED.includes(name) && screenshot(page, `${name}-${colorScheme}${suffix}`);
      await page.goto(jobs.served.address + path);
      await page.waitForSelector(there);
      assert.deepEqual(await barriers(page), [], name);
      await picture("");
      await page.setViewportSize(PHONE);
      await picture("-phone");
      assert.deepEqual(await barriers(page), [], `${name} on a phone`);
      const overflow = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
      assert.ok(overflow <= 0, `${name} is ${overflow} pixels too wide for a phone`);
      assert.deepEqual(complaints, [], name);
      await page.close();
    }
  });
}

test("the page of the API has every request, and tries it", async () => {
  const description = await (await fetch(`${jobs.served.address}/openapi.json`)).json();
  const { page, complaints } = await blank(jobs.served);
  await page.goto(`${jobs.served.address}/docs/`);
  await page.waitForSelector(".request");
  const told = await page.$$eval(".request h3 code", (codes) => codes.map((code) => code.textContent));
  assert.deepEqual(new Set(told), new Set(Object.keys(description.paths)));
  const models = page.locator("[aria-label='get /api/v1/models']");
  assert.match(await models.locator(".shell code").textContent(), /^curl -fsS http.*\/api\/v1\/models$/);
  await models.locator("summary").click();
  const held = await models.locator("details code").allTextContents();
  for (const member of ["data[].files.*.url", "data[].evaluations[].reports[].lifted"]) assert.ok(held.includes(member), `${held}`);
  await models.locator("button:has-text('Try it')").click();
  // All cards together are longer than what is shown.
  await page.waitForFunction(() => /^200[^]*"lifted"[^]*first 20,000 of [\d,]+ characters$/.test(document.querySelector("[aria-label='get /api/v1/models'] .answer").textContent));
  await screenshot(page, "api");
  assert.deepEqual(complaints, []);
  await page.close();
});
