// The jobs page: from a form to a policy that is tried in the demo, with a server that comes and goes.

import assert from "node:assert/strict";
import { mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { barriers, blank, open, PATIENCE, PHONE, screenshot, serve, untilReady } from "./chromium.js";
import { BOX, bottle } from "./meshes.js";

let served;
let folder;
before(async () => {
  folder = mkdtempSync(join(tmpdir(), "ngf-"));
  served = await open({ data: join(folder, "data") });
});
after(async () => {
  await served?.close();
  rmSync(folder, { recursive: true, force: true });
});

const api = async (path, body) => {
  const answer = await fetch(`${served.address}/api/v1/${path}`, body && { method: "POST", body: JSON.stringify(body) });
  assert.ok(answer.ok, `${path}: ${answer.status}`);
  return answer.json();
};

async function visitJobs(route = "", options = {}) {
  const { page, complaints } = await blank(served, options);
  await page.goto(`${served.address}/jobs/${route}`);
  return { page, complaints };
}

const stands = (page, status) => page.waitForSelector(`.detail-job .chip.is-${status}`);

// A job once it is over.
async function over(id) {
  for (;;) {
    const job = await api(`jobs/${id}?wait=30s`);
    if (["succeeded", "failed", "cancelled"].includes(job.status)) return job;
  }
}

// A job that is done.
async function made(kind, params, name) {
  const { id } = await api("jobs", { kind, params, name });
  const job = await over(id);
  assert.equal(job.status, "succeeded", JSON.stringify(job.error));
  return job;
}

// A job that takes long and needs nothing.
const long = (params = {}, name = null) =>
  api("jobs", { kind: "policy.evaluate", params: { model_id: "planner", object: "sugar_box", attempts: 10_000, ...params }, name });

async function until(holds) {
  for (const end = Date.now() + PATIENCE; !holds(); ) {
    assert.ok(Date.now() < end, `it never holds: ${holds}`);
    await new Promise((resolve) => setTimeout(resolve, 50));
  }
}

async function stop(id) {
  await api(`jobs/${id}/cancel`, {});
  return over(id);
}

async function uploaded(name = "box.obj", body = BOX) {
  const answer = await fetch(`${served.address}/api/v1/meshes?name=${name}`, { method: "POST", body });
  assert.ok(answer.ok, `${answer.status}`);
  return answer.json();
}

test("a dataset is asked for with the form, watched, and one of its demonstrations played", async () => {
  const { page, complaints } = await visitJobs();
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
  const { outputs } = await made("dataset.generate", { preset: "smoke" });
  const { dataset_id } = outputs;
  const encoder = await made("encoder.train", { dataset_id, steps: 50, checkpoint: 50 }, "First encoder");
  const other = await made("encoder.train", { dataset_id, steps: 50, checkpoint: 50, rate: 0.01 }, "Other encoder");
  // What only sees does not act.
  const blind = { kind: "policy.evaluate", params: { model_id: encoder.outputs.model_id, object: "sugar_box" } };
  const refused = await fetch(`${served.address}/api/v1/jobs?dry_run=true`, { method: "POST", body: JSON.stringify(blind) });
  assert.match((await refused.json()).detail, /is an encoder, which does not act/);
  const params = { dataset_id, encoder_id: encoder.outputs.model_id, steps: 100_000, batch: 8, checkpoint: 100 };
  const { id } = await api("jobs", { kind: "policy.train", params, name: "A long one" });

  const { page, complaints } = await visitJobs(`#jobs/${id}`);
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
  await page.click("button:has-text('Pause')");
  await stands(page, "paused");
  await page.click("button:has-text('Resume')");
  await stands(page, "running");
  await page.click("button:has-text('Stop')");
  await stands(page, "cancelled");

  await page.check("[aria-label='Compare First encoder']");
  await page.check("[aria-label='Compare Other encoder']");
  await page.waitForSelector("h1:has-text('Comparison')");
  assert.match(await page.textContent(".detail table"), /rate.*0\.01/);
  await page.waitForSelector(".chart canvas");
  await screenshot(page, "jobs-comparison");

  await page.goto(`${served.address}/jobs/#jobs/${other.id}`);
  await page.click("button:has-text('Delete')");
  await page.click("button:has-text('Undo')");
  assert.equal((await api(`jobs/${other.id}`)).id, other.id);
  await page.click("button:has-text('Delete')");
  await page.waitForFunction((id) => !document.querySelector(`[data-id=${id}]`), other.id);
  assert.equal((await fetch(`${served.address}/api/v1/jobs/${other.id}`)).status, 404);
  assert.deepEqual(complaints, []);
  await page.close();
});

test("an evaluation shows its table, and the model knows of it", async () => {
  const params = { model_id: "default", object: "sugar_box", attempts: 2 };
  const { id } = await made("policy.evaluate", params, "Two attempts");
  const { page, complaints } = await visitJobs(`#jobs/${id}`);
  await page.waitForSelector("td:has-text('of 2')");
  await page.click("a:has-text('default')");
  await page.waitForSelector("td:has-text('of 2')");
  await screenshot(page, "jobs-model");
  assert.deepEqual(complaints, []);
  await page.close();
});

test("an attempt that failed in an evaluation is made again in the demo, and ends there in the same state", async () => {
  // A bottle that lies, because it is drawn with y up, and that is too heavy for a hand.
  const { id: mesh_id } = await uploaded("bottle.obj", bottle(4000).replaceAll(/v (\S+) (\S+) (\S+)/g, "v $1 $3 $2"));
  const params = { model_id: "default", mesh_id, mass_kg: 6, attempts: 2, seed: 3 };
  const { id } = await made("policy.evaluate", params, "A bottle of lead");
  const { page, complaints } = await visitJobs(`#jobs/${id}`);
  await page.click("summary:has-text('2 ')");
  await screenshot(page, "jobs-attempts");
  const [demo] = await Promise.all([page.context().waitForEvent("page"), page.click("a:has-text('seed 4')")]);
  await demo.waitForSelector("#hash:has-text('as in the link')", { timeout: PATIENCE });
  assert.equal(await demo.locator("#failures article").count(), 0);
  assert.deepEqual(complaints, []);
  await demo.close();
  await page.close();
  await fetch(`${served.address}/api/v1/meshes/${mesh_id}`, { method: "DELETE" });
});

test("a mesh is uploaded, evaluated on by a link, tried in the demo, and deleted", async () => {
  const { page, complaints } = await visitJobs("#meshes");
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

test("a server that does no jobs says what to start", async (t) => {
  const { address, server } = await serve();
  t.after(() => server.kill());
  const { page, complaints } = await blank({ address, browser: served.browser });
  await page.goto(`${address}/jobs/`);
  assert.match(await page.textContent(".failure"), /no folder for jobs.*Start one with .ngf serve --data DIR/);
  // What needs no jobs is there.
  await page.click(".tabs a:has-text('Models')");
  await page.waitForSelector("td:has-text('default')");
  await page.click(".tabs a[href='#jobs']");
  await page.waitForSelector(".failure:has-text('Start one with')");
  // Whether there are jobs can only be found out by asking.
  assert.deepEqual(complaints.filter((text) => !text.includes("404")), []);
  await page.close();
});

test("a filter holds while a job runs", async () => {
  const { page, complaints } = await visitJobs();
  await page.waitForSelector("[data-state=live]");
  await page.selectOption("#filter-status", { label: "failed" });
  const { id } = await long();
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

test("a deletion that was asked for twice is taken back once, and by whatever else is asked", async () => {
  const { id } = await long();
  await stop(id);
  const { page, complaints } = await blank(served);
  const deletions = [];
  page.on("request", (request) => request.method() === "DELETE" && deletions.push(request.url()));
  await page.clock.install();
  await page.goto(`${served.address}/jobs/#jobs/${id}`);
  await stands(page, "cancelled");
  await page.click("button:has-text('Delete')");
  await page.click("button:has-text('Delete')");
  await page.click("button:has-text('Undo')");
  await page.waitForSelector("text=This job is not deleted.");
  await page.click("button:has-text('Delete')");
  page.once("dialog", (dialog) => dialog.accept("Kept"));
  await page.click("button:has-text('Rename')");
  await page.waitForSelector("h1:has-text('Kept')");
  await page.waitForSelector("text=This job is not deleted.");
  await page.clock.fastForward(10_000);
  // What the page asks for now comes behind any deletion.
  assert.equal(await page.evaluate(async (id) => (await fetch(`../api/v1/jobs/${id}`)).status, id), 200);
  assert.deepEqual(deletions, []);
  assert.deepEqual(complaints, []);
  await page.close();
});

test("a deletion is carried out though the page is left", async () => {
  const { id } = await long();
  await stop(id);
  const { page } = await visitJobs(`#jobs/${id}`);
  await page.click("button:has-text('Delete')");
  await page.waitForSelector("text=This job will be deleted");
  await page.goto(`${served.address}/docs/`);
  const status = async () => (await fetch(`${served.address}/api/v1/jobs/${id}`)).status;
  for (const end = Date.now() + 5000; (await status()) !== 404; ) assert.ok(Date.now() < end, "it is still there");
  await page.close();
});

test("what was stopped is tried again, and asked for again with changes", async () => {
  const { id } = await long({ seed: 7 }, "Tried");
  await stop(id);
  const { page, complaints } = await visitJobs(`#jobs/${id}`);
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
  const copy = await stop(new URL(page.url()).hash.split("/")[1]);
  assert.notEqual(copy.id, id);
  const { seed, object, model_id } = copy.params;
  assert.deepEqual({ seed, object, model_id }, { seed: 8, object: "sugar_box", model_id: "planner" });
  assert.deepEqual(complaints, []);
  await page.close();
});

test("an answer that was lost is asked for again", async () => {
  const { id } = await long();
  const { page } = await visitJobs(`#jobs/${id}`);
  await stands(page, "running");
  let asked = 0;
  await page.route(`**/api/v1/jobs/${id}`, (route) => (asked++ < 2 ? route.abort() : route.continue()));
  await stop(id);
  await stands(page, "cancelled");
  assert.ok(asked > 2, String(asked));
  await page.close();
});

test("an answer that was overtaken does not stay", async () => {
  const { id } = await long();
  const { page } = await visitJobs(`#jobs/${id}`);
  await stands(page, "running");
  let [asked, late] = [0, null];
  await page.route(`**/api/v1/jobs/${id}`, async (route) => {
    asked += 1;
    if (asked > 1) return route.continue();
    const answer = await route.fetch();
    late = () => route.fulfill({ response: answer });
  });
  await api(`jobs/${id}/pause`, {});
  await until(() => late);
  await stop(id);
  await stands(page, "cancelled");
  const before = asked;
  await late();
  await until(() => asked > before);
  await stands(page, "cancelled");
  await page.close();
});

test("a comparison says which of its jobs is gone", async () => {
  const ids = [];
  for (const name of ["the one that stays", "the one that goes"]) {
    ids.push((await long({}, name)).id);
    await stop(ids.at(-1));
  }
  await fetch(`${served.address}/api/v1/jobs/${ids[1]}`, { method: "DELETE" });
  const { page } = await visitJobs(`#compare/${ids.join(",")}`);
  await page.waitForSelector("#detail .legend:has-text('the one that stays')");
  assert.match(await page.textContent("#detail .failure"), new RegExp(ids[1]));
  assert.equal(await page.locator("#detail .legend li").count(), 1);
  await page.close();
});

test("a server with a token asks for it, and takes no other", async (t) => {
  const [token, tokenFile] = ["open-sesame-open-sesame", join(folder, "token")];
  writeFileSync(tokenFile, token);
  const { address, server } = await serve({ data: join(folder, "guarded"), tokenFile });
  t.after(() => server.kill());
  const { page } = await blank({ address, browser: served.browser });
  await page.goto(`${address}/jobs/`);
  // What a job takes is asked of the server, too; that alone asks nobody for a token.
  await page.click("text=New job");
  await page.waitForSelector(".estimate:has-text('asks for its token when you begin')");
  assert.equal(await page.locator("dialog[open], .new-job .failure").count(), 0);
  await page.click("button:has-text('Copy as curl')");
  await page.waitForSelector(".new-job .command:has-text('$TOKEN')");
  await page.click("button:has-text('Begin')");
  await page.waitForSelector("dialog:has-text('asks for its token')");
  assert.deepEqual(await barriers(page), []);
  await page.keyboard.press("Escape");
  await page.waitForSelector(".new-job .failure:has-text('Ask whoever runs the server')");
  await page.click("button:has-text('Begin')");
  await page.waitForSelector("dialog:has-text('asks for its token')");
  await page.fill("dialog input", "open-says-me-open-says-me");
  await page.keyboard.press("Enter");
  await page.waitForSelector("dialog:has-text('not the server')");
  await page.fill("dialog input", token);
  await page.keyboard.press("Enter");
  await page.waitForSelector(".detail-job .chip");
  // It is known from now on.
  await page.click(".detail-job button:has-text('Stop')");
  await stands(page, "cancelled");
  assert.equal(await page.locator("dialog[open]").count(), 0);
  await page.close();
});

test("a job that fails says why, and what to do", async () => {
  // It waits behind another one while its mesh is deleted.
  const other = await long();
  const mesh = await uploaded();
  const { id } = await api("jobs", { kind: "mesh.prepare", params: { mesh_id: mesh.id } });
  await fetch(`${served.address}/api/v1/meshes/${mesh.id}`, { method: "DELETE" });
  await stop(other.id);
  assert.equal((await over(id)).status, "failed");
  const { page, complaints } = await visitJobs(`#jobs/${id}`);
  await stands(page, "failed");
  const card = await page.textContent(".detail-job .failure");
  assert.match(card, /could not be started.*was deleted.*look at the program and the data folder.*launch_failed/);
  assert.match(await page.textContent(`[data-id=${id}]`), /failed/);
  assert.deepEqual(complaints, []);
  await page.close();
});

test("what cannot be asked for is told there, and tried again", async () => {
  await uploaded();
  const { page } = await visitJobs("#meshes");
  await page.route(/\/api\/v1\/(meshes\/|jobs\?)/, (route) => route.abort());
  await page.click("button:has-text('Delete')");
  await page.waitForSelector("#detail .failure:has-text('Start one with')");
  await page.selectOption("#filter-kind", { label: "Evaluate a policy" });
  await page.waitForSelector("#list-end .failure");
  await page.unrouteAll();
  await page.click("#list-end button:has-text('Try again')");
  await page.waitForSelector(".row");
  assert.equal(await page.$("#list-end .failure"), null);
  await page.click("button:has-text('Delete')");
  await page.waitForSelector("text=None yet.");
  await page.close();
});

test("a server that is killed and comes back is noticed, and nothing is missing then", async () => {
  const { id } = await api("jobs", { kind: "dataset.generate", params: { preset: "smoke", seed: 77 } });
  const { page } = await visitJobs(`#jobs/${id}`);
  await page.waitForSelector("[data-state=live]");
  served.server.kill("SIGKILL");
  await page.waitForSelector("[data-state=lost]");
  const port = new URL(served.address).port;
  const again = await serve({ port, data: join(folder, "data") });
  served.server = again.server;
  const { close } = served;
  served.close = async () => (await close(), again.server.kill());
  await page.waitForSelector("[data-state=live]");
  await stands(page, "succeeded");
  await page.close();
});

test("a thousand jobs scroll", async () => {
  const ids = [];
  for (let k = 0; k < 1000; k++) {
    // The hundred that may wait are soon full of what nobody wants.
    const { id } = await api("jobs", { kind: "policy.evaluate", params: { model_id: "planner", object: "sugar_box" } });
    await api(`jobs/${id}/cancel`, {});
    ids.push(id);
  }
  const { page } = await visitJobs();
  const oldest = `[data-id=${ids[0]}]`;
  for (let k = 0; k < 30 && !(await page.$(oldest)); k++) {
    await page.evaluate(() => document.getElementById("rail").scrollTo(0, 1e9));
    await page.waitForTimeout(200);
  }
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
    const { data: trainings } = await api("jobs?limit=1&kind=policy.train");
    const { data: datasets } = await api("datasets?limit=1");
    await uploaded();
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
      const { page, complaints } = await blank(served, { colorScheme });
      const picture = async (suffix) => PICTURED.includes(name) && screenshot(page, `${name}-${colorScheme}${suffix}`);
      await page.goto(served.address + path);
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
  const description = await (await fetch(`${served.address}/openapi.json`)).json();
  const { page, complaints } = await blank(served);
  await page.goto(`${served.address}/docs/`);
  await page.waitForSelector(".request");
  const told = await page.$$eval(".request h3 code", (codes) => codes.map((code) => code.textContent));
  assert.deepEqual(new Set(told), new Set(Object.keys(description.paths)));
  const models = page.locator("[aria-label='get /api/v1/models']");
  assert.match(await models.locator(".shell code").textContent(), /^curl -fsS http.*\/api\/v1\/models$/);
  await models.locator("button:has-text('Try it')").click();
  await page.waitForFunction(() => /200[^]*"default"/.test(document.querySelector("[aria-label='get /api/v1/models'] .answer").textContent));
  await screenshot(page, "api");
  assert.deepEqual(complaints, []);
  await page.close();
});
