// Jobs page and API page: forms, training, evaluation, charts, meshes, accessibility.

import assert from "node:assert/strict";
import { after, afterEach, before, test } from "node:test";
import { a11yViolations, newPage, TIMEOUT_MS, PHONE, screenshot, untilReady } from "./chromium.js";
import { openJobs, untilStatus, until } from "./jobs_fixture.js";
import { bottle } from "./meshes.js";

let jobs;
before(async () => (jobs = await openJobs()));
afterEach(() => jobs.cancelAll());
after(() => jobs?.close());

test("dataset job is started with the form, monitored, and a demonstration played", async () => {
  const { page, errors } = await jobs.visit();
  await page.click("text=New job");
  await page.selectOption("[data-param=preset] select", "smoke");
  await page.fill("[data-param=seed] input", "-1");
  // A parameter that the server rejects is marked.
  await page.waitForSelector("[data-param=seed] [aria-invalid=true]");
  await page.waitForSelector(".new-job .failure");
  await page.fill("[data-param=seed] input", "5");
  await page.waitForSelector(".new-job .failure", { state: "detached" });
  await page.waitForFunction(() => /Estimate:/.test(document.querySelector(".estimate").textContent));
  await page.fill(".line:has-text('Name') >> nth=0 >> input", "Test dataset");
  await screenshot(page, "jobs-new");
  await page.click("button:has-text('Start')");
  await untilStatus(page, "succeeded");
  assert.equal(await page.textContent("h1"), "Test dataset");
  assert.match(await page.textContent(".row a"), /Test dataset.*Succeeded/);
  await page.waitForFunction(() => document.querySelector(".log").textContent.includes("sugar"));
  await page.click("a:has-text('ds_')");
  await page.waitForSelector("td:has-text('Sugar box')");
  await screenshot(page, "jobs-dataset");
  const [demo] = await Promise.all([page.context().waitForEvent("page"), page.click("a:has-text('Play')")]);
  await demo.waitForFunction(() => /^Demonstration, episode 0: sugar box/.test(document.getElementById("hash").textContent));
  await demo.close();
  // The browser logs the expected 422 response as an error.
  assert.deepEqual(errors.filter((text) => !text.includes("422")), []);
  await page.close();
});

test("training is monitored, tried in the demo while running, paused, resumed, cancelled and compared", async () => {
  const { outputs } = await jobs.runJob("dataset.generate", { preset: "smoke" });
  const { dataset_id } = outputs;
  const encoder = await jobs.runJob("encoder.train", { dataset_id, steps: 50, checkpoint_every: 50 }, "First encoder");
  const other = await jobs.runJob("encoder.train", { dataset_id, steps: 50, checkpoint_every: 50, learning_rate: 0.01 }, "Other encoder");
  // An encoder is not a policy.
  const request = { kind: "policy.evaluate", params: { model_id: encoder.outputs.model_id, object: "sugar_box" } };
  const rejected = await fetch(`${jobs.served.address}/api/v1/jobs?dry_run=true`, { method: "POST", body: JSON.stringify(request) });
  assert.match((await rejected.json()).detail, /is an encoder, not a policy/);
  const params = { dataset_id, encoder_id: encoder.outputs.model_id, steps: 100_000, batch: 8, checkpoint_every: 100 };
  const { id } = await jobs.api("jobs", { kind: "policy.train", params, name: "A long one" });

  const { page, errors } = await jobs.visit(`#jobs/${id}`);
  await untilStatus(page, "running");
  await page.waitForSelector(".chart canvas");
  // The first checkpoint adds charts above the table, which move it. The second does not.
  await page.waitForFunction(() => document.querySelectorAll("[data-step]").length >= 2);
  // New rows wait while the pointer is over the table, so that links stay under it.
  await page.hover("a:has-text('Try in demo')");
  const numRows = await page.locator("[data-step]").count();
  const { data } = await jobs.api(`jobs/${id}/checkpoints`);
  await jobs.untilNumCheckpoints(id, data.length + 2);
  assert.equal(await page.locator("[data-step]").count(), numRows);
  await page.mouse.move(0, 0);
  await page.waitForFunction((n) => document.querySelectorAll("[data-step]").length > n, numRows);
  const [demo] = await Promise.all([
    page.context().waitForEvent("page"),
    page.click("a:has-text('Try in demo')"),
  ]);
  await demo.emulateMedia({ reducedMotion: "no-preference" });
  await demo.reload();
  const loaded = () => demo.textContent("#model");
  await demo.waitForFunction(() => /^Loaded: mdl_\w+$/.test(document.getElementById("model").textContent));
  await screenshot(page, "jobs-training");
  // The demo follows new checkpoints until another policy is selected.
  const first = await loaded();
  await demo.bringToFront();
  await untilReady(demo);
  await demo.keyboard.press("r");
  await demo.waitForFunction((first) => document.getElementById("model").textContent !== first, first);
  assert.match(await loaded(), /^Loaded: mdl_\w+$/);
  // No newer checkpoint is written while the job is paused.
  await jobs.api(`jobs/${id}/pause`, {});
  await demo.waitForSelector("#training-status:has-text('Using the latest checkpoint')");
  await jobs.api(`jobs/${id}/resume`, {});
  // The attempt is repeated automatically with the new checkpoint.
  await demo.waitForSelector("#phases .is-now");
  await demo.locator("#training").scrollIntoViewIfNeeded();
  await screenshot(demo, "demo-training");
  await demo.selectOption("#policy", "default");
  await demo.waitForFunction(() => document.getElementById("model").textContent === "Loaded: default");
  assert.equal(await demo.isChecked("#training-follow"), false);
  // The selection stays while two more checkpoints are written.
  for (let k = 0; k < 2; k += 1) {
    const newest = await demo.textContent("#training-status");
    await demo.waitForFunction((newest) => document.getElementById("training-status").textContent !== newest, newest);
  }
  assert.equal(await loaded(), "Loaded: default");
  await demo.reload();
  await untilReady(demo);
  assert.equal(await loaded(), "Loaded: default");
  assert.ok(await demo.isHidden("#training"));
  await demo.close();
  // Keyboard focus moves to the button that replaces the pressed one.
  const untilFocused = (text) => page.waitForFunction((text) => document.activeElement.textContent === text, text);
  await page.focus("button:has-text('Pause')");
  await page.keyboard.press("Enter");
  await untilStatus(page, "paused");
  await untilFocused("Resume");
  await page.keyboard.press("Enter");
  await untilStatus(page, "running");
  await untilFocused("Pause");
  await page.click("button:has-text('Cancel')");
  await untilStatus(page, "cancelled");

  await page.check("[aria-label='Compare First encoder']");
  await page.check("[aria-label='Compare Other encoder']");
  await page.waitForSelector("h1:has-text('Comparison')");
  assert.match(await page.textContent(".main-view table"), /learning_rate.*0\.01/);
  await page.waitForSelector(".chart canvas");
  await screenshot(page, "jobs-comparison");

  await page.goto(`${jobs.served.address}/jobs/#jobs/${other.id}`);
  await page.click("button:has-text('Delete')");
  await page.click("button:has-text('Undo')");
  assert.equal((await jobs.api(`jobs/${other.id}`)).id, other.id);
  await page.click("button:has-text('Delete')");
  await page.waitForFunction((id) => !document.querySelector(`[data-id=${id}]`), other.id);
  assert.equal((await fetch(`${jobs.served.address}/api/v1/jobs/${other.id}`)).status, 404);
  assert.deepEqual(errors, []);
  await page.close();
});

test("whole pipeline runs with one click and continues after a reload", async () => {
  const { page, errors } = await jobs.visit("#new");
  await page.click("button:has-text('Run the whole pipeline')");
  await page.waitForSelector("h1:has-text('Toy pipeline, 1 of 4')");
  await page.reload();
  await page.waitForSelector("h1:has-text('Toy pipeline, 4 of 4')", { timeout: TIMEOUT_MS });
  await untilStatus(page, "succeeded");
  await page.waitForSelector("td:has-text('of 4')");
  const { data } = await jobs.api("jobs?limit=4");
  assert.deepEqual(data.map(({ name, kind }) => [name.slice(-6), kind]), [
    ["4 of 4", "policy.evaluate"],
    ["3 of 4", "policy.train"],
    ["2 of 4", "encoder.train"],
    ["1 of 4", "dataset.generate"],
  ]);
  assert.equal(data[0].params.model_id, data[1].outputs.model_id);
  // A finished job links to the next one.
  await page.click(`[data-id=${data[2].id}] a`);
  await page.click(".outputs a:has-text('Train policy')");
  await page.waitForSelector("[data-param=encoder_id] select");
  assert.equal(await page.inputValue("[data-param=encoder_id] select"), data[2].outputs.model_id);
  // The reload aborts the event stream and every request in flight.
  assert.deepEqual(errors.filter((text) => !text.endsWith("net::ERR_ABORTED")), []);
  await page.close();
});

test("form marks required fields, accepts display names and preselects the newest encoder", async () => {
  const { data } = await jobs.api("models?limit=100");
  const encoders = data.filter(({ kind, created_at }) => kind === "encoder" && created_at);
  const newest = encoders.toSorted((a, b) => a.created_at.localeCompare(b.created_at)).at(-1);
  assert.ok(newest, "an encoder of the previous test");
  const { page, errors } = await jobs.visit("#new?kind=policy.train");
  await page.waitForSelector("[data-param=encoder_id] select");
  assert.equal(await page.inputValue("[data-param=encoder_id] select"), newest.id);
  const policies = await page.$$eval("[data-param=policy] option", (options) => options.map(({ textContent }) => textContent));
  assert.ok(policies.includes("ngf-pcd"), policies.join());
  for (const appearance of await page.$$eval("select", (selects) => selects.map((select) => getComputedStyle(select).appearance))) {
    assert.equal(appearance, "none");
  }
  await page.check(".kinds [value='policy.evaluate']", { force: true });
  await page.waitForSelector("[data-param=object].is-required input:required");
  await page.waitForSelector(".estimate:has-text('Required: Object.')");
  await screenshot(page, "jobs-form-required");
  assert.deepEqual(await a11yViolations(page), []);
  // Start names the missing field instead of an error of the API.
  await page.click("button:has-text('Start')");
  await page.waitForSelector("[data-param=object] [aria-invalid=true]:focus");
  assert.equal(await page.locator(".new-job .failure").count(), 0);
  await page.fill("[data-param=object] input", "Teapot");
  await page.waitForSelector(".new-job .failure:has-text('Object: unknown built-in object')");
  assert.doesNotMatch(await page.textContent(".new-job .failure"), /params\.|openapi/);
  await page.fill("[data-param=object] input", "Sugar box");
  await page.waitForFunction(() => /Estimate:/.test(document.querySelector(".estimate").textContent));
  await page.click("button:has-text('Copy as curl')");
  assert.match(await page.textContent(".new-job .command"), /"object":"sugar_box"/);
  assert.deepEqual(errors.filter((text) => !text.includes("422")), []);
  await page.close();
});

test("charts zoom and pan together, on linear and logarithmic axes", async () => {
  const { outputs } = await jobs.runJob("dataset.generate", { preset: "smoke" });
  const { id } = await jobs.runJob("encoder.train", { dataset_id: outputs.dataset_id, steps: 400, batch: 8, checkpoint_every: 400 });
  const { page, errors } = await jobs.visit(`#jobs/${id}`);
  const over = page.locator(".chart .u-over");
  await over.nth(1).waitFor();
  await over.nth(0).scrollIntoViewIfNeeded();
  const box = await over.nth(0).boundingBox();
  const moveTo = (fraction) => page.mouse.move(box.x + fraction * box.width, box.y + box.height / 2, { steps: 4 });
  const drag = async (from, to, button = "left") => (await moveTo(from), await page.mouse.down({ button }), await moveTo(to), await page.mouse.up({ button }));
  // Steps at the center of the first two charts.
  const centers = async () => {
    await moveTo(0.5);
    const step = (chart) => page.locator(".chart").nth(chart).locator(".u-value").first().textContent();
    return Promise.all([0, 1].map(async (chart) => Number((await step(chart)).replaceAll(",", ""))));
  };
  const reset = () => page.mouse.dblclick(box.x + box.width / 2, box.y + box.height / 2);
  for (const isLog of [false, true]) {
    await page.getByLabel("Log x").setChecked(isLog);
    const unzoomed = await centers();
    await drag(0.3, 0.7);
    const zoomed = await centers();
    await page.keyboard.down("Shift");
    await drag(0.9, 0.1);
    await page.keyboard.up("Shift");
    const panned = await centers();
    assert.ok(panned.every((step, chart) => step > zoomed[chart]), `${panned} after ${zoomed}, log x: ${isLog}`);
    // Panning back restores the range.
    await page.keyboard.down("Shift");
    await drag(0.1, 0.9);
    await page.keyboard.up("Shift");
    assert.deepEqual(await centers(), zoomed, `log x: ${isLog}`);
    // Other mouse buttons have no effect.
    await drag(0.2, 0.4, "right");
    assert.deepEqual(await centers(), zoomed, `log x: ${isLog}`);
    await reset();
    assert.deepEqual(await centers(), unzoomed, `log x: ${isLog}`);
  }
  assert.deepEqual(errors, []);
  await page.close();
});

test("evaluation results are shown in the job and in the model", async () => {
  const params = { model_id: "default", object: "sugar_box", attempts: 2 };
  const { id } = await jobs.runJob("policy.evaluate", params, "Two attempts");
  const { page, errors } = await jobs.visit(`#jobs/${id}`);
  await page.waitForSelector("td:has-text('of 2')");
  // Opening a row by keyboard moves the focus to the main view.
  await page.goto(`${jobs.served.address}/jobs/#jobs`);
  await page.focus("#job-rows a:has-text('Two attempts')");
  await page.keyboard.press("Enter");
  await page.waitForFunction(() => document.activeElement.id === "main-view");
  await page.waitForSelector("td:has-text('of 2')");
  await page.click("a:has-text('default')");
  await page.waitForSelector("td:has-text('of 2')");
  await screenshot(page, "jobs-model");
  assert.deepEqual(errors, []);
  await page.close();
});

test("failed attempt of an evaluation is reproduced in the demo by its link", async () => {
  // A y-up bottle that is too heavy for the hand.
  const { id: mesh_id } = await jobs.uploadMesh("bottle.obj", bottle(4000).replaceAll(/v (\S+) (\S+) (\S+)/g, "v $1 $3 $2"));
  const params = { model_id: "default", mesh_id, mass_kg: 6, attempts: 2, seed: 3 };
  const { id } = await jobs.runJob("policy.evaluate", params, "Heavy bottle");
  const { page, errors } = await jobs.visit(`#jobs/${id}`);
  await page.waitForSelector("td:has-text('bottle.obj')");
  await page.click(".attempts summary");
  await screenshot(page, "jobs-attempts");
  const [demo] = await Promise.all([page.context().waitForEvent("page"), page.click("a:has-text('Seed 4')")]);
  await demo.waitForSelector("#hash:has-text('(matches the link)')", { timeout: TIMEOUT_MS });
  assert.equal(await demo.locator("#failures article").count(), 0);
  assert.deepEqual(errors, []);
  await demo.close();
  await page.close();
  await fetch(`${jobs.served.address}/api/v1/meshes/${mesh_id}`, { method: "DELETE" });
});

test("mesh is uploaded, tried in the demo and deleted", async () => {
  const { page, errors } = await jobs.visit("#meshes");
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
  await page.waitForSelector("text=No meshes yet.");
  assert.deepEqual(errors.filter((text) => !text.includes("422")), []);
  await page.close();
});

test("status filter is applied while a job runs", async () => {
  const { page, errors } = await jobs.visit();
  await page.waitForSelector("[data-state=live]");
  await page.selectOption("#filter-status", { label: "Failed" });
  const { id } = await jobs.startLongJob();
  const row = `[data-id=${id}]`;
  // A selected job is shown even if the filter hides it.
  await page.evaluate((id) => (location.hash = `#jobs/${id}`), id);
  await untilStatus(page, "running");
  assert.equal(await page.$(row), null);
  await page.selectOption("#filter-status", { label: "Active" });
  await page.waitForSelector(row);
  await page.click("button:has-text('Cancel')");
  await untilStatus(page, "cancelled");
  await page.waitForSelector(row, { state: "detached" });
  await page.selectOption("#filter-status", { label: "Any status" });
  await page.waitForSelector(`${row}:has-text('Cancelled')`);
  assert.deepEqual(errors, []);
  await page.close();
});

test("cancelled job is retried and duplicated with changes", async () => {
  const { id } = await jobs.startLongJob({ seed: 7 }, "Original");
  await jobs.cancel(id);
  const { page, errors } = await jobs.visit(`#jobs/${id}`);
  // Resume if the job had started, otherwise Retry.
  await page.click("button:has-text('Retry'), button:has-text('Resume')");
  await untilStatus(page, "running");
  await page.click("button:has-text('Cancel')");
  await untilStatus(page, "cancelled");
  await page.click("text=Duplicate");
  await page.waitForSelector("[data-param=seed] input");
  assert.equal(await page.inputValue("[data-param=seed] input"), "7");
  await page.fill("[data-param=seed] input", "8");
  await page.click("button:has-text('Start')");
  await page.waitForSelector("h1:has-text('Original (copy)')");
  const copy = await jobs.cancel(new URL(page.url()).hash.split("/")[1]);
  assert.notEqual(copy.id, id);
  const { seed, object, model_id } = copy.params;
  assert.deepEqual({ seed, object, model_id }, { seed: 8, object: "sugar_box", model_id: "planner" });
  assert.deepEqual(errors, []);
  await page.close();
});

test("list of a thousand jobs scrolls to its end", async () => {
  const ids = [];
  for (let k = 0; k < 1000; k++) {
    // Cancelled at once: the queue accepts a hundred jobs.
    const { id } = await jobs.api("jobs", { kind: "policy.evaluate", params: { model_id: "planner", object: "sugar_box" } });
    await jobs.api(`jobs/${id}/cancel`, {});
    ids.push(id);
  }
  const { page } = await jobs.visit();
  const oldest = `[data-id=${ids[0]}]`;
  // Scrolls to the end before the next frame, as with a key held down.
  await page.evaluate(() => {
    const toEnd = () => document.getElementById("job-list").scrollTo(0, 1e9);
    new MutationObserver(toEnd).observe(document.getElementById("job-rows"), { childList: true });
    toEnd();
  });
  await page.waitForSelector(oldest);
  const start = Date.now();
  await page.click(`${oldest} a`);
  await untilStatus(page, "cancelled");
  assert.ok(Date.now() - start < 3000, `${Date.now() - start} ms`);
  await page.close();
});

// Views with screenshots.
const WITH_SCREENSHOT = ["demo", "job", "new-job", "models", "api"];

for (const colorScheme of ["light", "dark"]) {
  test(`all pages are accessible and fit a phone, ${colorScheme}`, async () => {
    const { data: trainings } = await jobs.api("jobs?limit=1&kind=policy.train");
    const { data: datasets } = await jobs.api("datasets?limit=1");
    await jobs.uploadMesh();
    for (const [name, path, selector] of [
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
      const { page, errors } = await newPage(jobs.served, { colorScheme });
      const capture = async (suffix) => WITH_SCREENSHOT.includes(name) && screenshot(page, `${name}-${colorScheme}${suffix}`);
      await page.goto(jobs.served.address + path);
      await page.waitForSelector(selector);
      assert.deepEqual(await a11yViolations(page), [], name);
      await capture("");
      await page.setViewportSize(PHONE);
      await capture("-phone");
      assert.deepEqual(await a11yViolations(page), [], `${name} on a phone`);
      const overflow = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
      assert.ok(overflow <= 0, `${name} is ${overflow} pixels too wide for a phone`);
      assert.deepEqual(errors, [], name);
      await page.close();
    }
  });
}

test("API page lists every request and can send one", async () => {
  const openapi = await (await fetch(`${jobs.served.address}/openapi.json`)).json();
  const { page, errors } = await newPage(jobs.served);
  await page.goto(`${jobs.served.address}/docs/`);
  await page.waitForSelector(".request");
  const shown = await page.$$eval(".request h3 code", (codes) => codes.map((code) => code.textContent));
  assert.deepEqual(new Set(shown), new Set(Object.keys(openapi.paths)));
  const models = page.locator("[aria-label='get /api/v1/models']");
  assert.match(await models.locator(".shell code").textContent(), /^curl -fsS http.*\/api\/v1\/models$/);
  await models.locator("summary").click();
  const members = await models.locator("details code").allTextContents();
  for (const member of ["data[].files.*.url", "data[].evaluations[].reports[].lifted"]) assert.ok(members.includes(member), `${members}`);
  await models.locator("button:has-text('Try it')").click();
  // The response with all cards is truncated.
  await page.waitForFunction(() => /^200[^]*"lifted"[^]*first 20,000 of [\d,]+ characters$/.test(document.querySelector("[aria-label='get /api/v1/models'] .response").textContent));
  await screenshot(page, "api");
  assert.deepEqual(errors, []);
  await page.close();
});
