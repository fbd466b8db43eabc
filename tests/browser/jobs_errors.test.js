// Error handling of the Jobs page: failed jobs, lost responses, missing or restarted servers.

import assert from "node:assert/strict";
import { writeFileSync } from "node:fs";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { a11yViolations, newPage, TIMEOUT_MS, screenshot, serve } from "./chromium.js";
import { openJobs, untilStatus, until } from "./jobs_fixture.js";

let jobs;
before(async () => (jobs = await openJobs()));
after(() => jobs?.close());

test("server without jobs shows the command to start one", async (t) => {
  const { address, server } = await serve();
  t.after(() => server.kill());
  const { page, errors } = await newPage({ address, browser: jobs.served.browser });
  await page.goto(`${address}/jobs/`);
  assert.match(await page.textContent(".failure"), /jobs are disabled.*Start one with ngf serve --data-dir DIR/);
  // Views that need no jobs work.
  await page.click(".tabs a:has-text('Models')");
  await page.waitForSelector("td:has-text('default')");
  await page.click(".tabs a[href='#jobs']");
  await page.waitForSelector(".failure:has-text('Start one with')");
  // The request for jobs fails with 404.
  assert.deepEqual(errors.filter((text) => !text.includes("404")), []);
  await page.close();
});

test("repeated deletion is undone once, and any other action cancels it", async () => {
  const { id } = await jobs.startLongJob();
  await jobs.cancel(id);
  const { page, errors } = await newPage(jobs.served);
  const deletions = [];
  page.on("request", (request) => request.method() === "DELETE" && deletions.push(request.url()));
  await page.clock.install();
  await page.goto(`${jobs.served.address}/jobs/#jobs/${id}`);
  await untilStatus(page, "cancelled");
  await page.click("button:has-text('Delete')");
  await page.click("button:has-text('Delete')");
  await page.click("button:has-text('Undo')");
  await page.waitForSelector("text=Deletion cancelled.");
  await page.click("button:has-text('Delete')");
  page.once("dialog", (dialog) => dialog.accept("Kept"));
  await page.click("button:has-text('Rename')");
  await page.waitForSelector("h1:has-text('Kept')");
  await page.waitForSelector("text=Deletion cancelled.");
  await page.clock.fastForward(10_000);
  // This request would follow any deletion.
  assert.equal(await page.evaluate(async (id) => (await fetch(`../api/v1/jobs/${id}`)).status, id), 200);
  assert.deepEqual(deletions, []);
  assert.deepEqual(errors, []);
  await page.close();
});

test("pending deletion is executed when the page is left", async () => {
  const { id } = await jobs.startLongJob();
  await jobs.cancel(id);
  const { page } = await jobs.visit(`#jobs/${id}`);
  await page.click("button:has-text('Delete')");
  await page.waitForSelector("text=This job will be deleted");
  await page.goto(`${jobs.served.address}/docs/`);
  const status = async () => (await fetch(`${jobs.served.address}/api/v1/jobs/${id}`)).status;
  for (const end = Date.now() + 5000; (await status()) !== 404; ) assert.ok(Date.now() < end, "the job was not deleted");
  await page.close();
});

test("lost response is requested again", async () => {
  const { id } = await jobs.startLongJob();
  const { page } = await jobs.visit(`#jobs/${id}`);
  await untilStatus(page, "running");
  let numRequests = 0;
  await page.route(`**/api/v1/jobs/${id}`, (route) => (numRequests++ < 2 ? route.abort() : route.continue()));
  await jobs.cancel(id);
  await untilStatus(page, "cancelled");
  assert.ok(numRequests > 2, String(numRequests));
  await page.close();
});

test("job is created once when the first response is lost", async () => {
  const { page } = await jobs.visit("#new?kind=policy.evaluate&model_id=planner&object=sugar_box&attempts=1&seed=77");
  let lost = 0;
  await page.route("**/api/v1/jobs", async (route) => {
    if (route.request().method() !== "POST" || lost++ > 0) return route.continue();
    await route.fetch();
    return route.abort();
  });
  await page.waitForFunction(() => /Estimate:/.test(document.querySelector(".estimate")?.textContent));
  await page.click("button:has-text('Start')");
  await page.waitForSelector(".new-job .failure");
  await page.click("button:has-text('Start')");
  await page.waitForSelector(".job-detail");
  const { data } = await jobs.api("jobs?kind=policy.evaluate");
  assert.equal(data.filter(({ params }) => params.seed === 77).length, 1);
  await page.close();
});

test("comparison shows the status of its jobs", async () => {
  const ids = [];
  for (const name of ["one", "another"]) ids.push((await jobs.startLongJob({}, name)).id);
  const { page } = await jobs.visit(`#compare/${ids.join(",")}`);
  await page.waitForSelector("#main-view .legend .is-running");
  for (const id of ids) await jobs.cancel(id);
  await page.waitForFunction(() => document.querySelectorAll("#main-view .legend .is-cancelled").length === 2);
  await page.close();
});

test("outdated response is replaced", async () => {
  const { id } = await jobs.startLongJob();
  const { page } = await jobs.visit(`#jobs/${id}`);
  await untilStatus(page, "running");
  let [numRequests, deliver] = [0, null];
  await page.route(`**/api/v1/jobs/${id}`, async (route) => {
    numRequests += 1;
    if (numRequests > 1) return route.continue();
    const response = await route.fetch();
    deliver = () => route.fulfill({ response });
  });
  await jobs.api(`jobs/${id}/pause`, {});
  await until(() => deliver);
  await jobs.cancel(id);
  await untilStatus(page, "cancelled");
  const before = numRequests;
  await deliver();
  await until(() => numRequests > before);
  await untilStatus(page, "cancelled");
  await page.close();
});

test("comparison reports a deleted job", async () => {
  const ids = [];
  for (const name of ["kept job", "deleted job"]) {
    ids.push((await jobs.startLongJob({}, name)).id);
    await jobs.cancel(ids.at(-1));
  }
  await fetch(`${jobs.served.address}/api/v1/jobs/${ids[1]}`, { method: "DELETE" });
  const { page } = await jobs.visit(`#compare/${ids.join(",")}`);
  await page.waitForSelector("#main-view .legend:has-text('kept job')");
  assert.match(await page.textContent("#main-view .failure"), new RegExp(ids[1]));
  assert.equal(await page.locator("#main-view .legend li").count(), 1);
  await page.close();
});

test("token is requested for write requests, and a wrong one is rejected", async (t) => {
  const [token, tokenFile] = ["open-sesame-open-sesame", join(jobs.folder, "token")];
  writeFileSync(tokenFile, token);
  const { address, server } = await serve({ data: join(jobs.folder, "guarded"), tokenFile });
  t.after(() => server.kill());
  const { page } = await newPage({ address, browser: jobs.served.browser });
  await page.goto(`${address}/jobs/`);
  // Validation of the form does not open the token dialog.
  await page.click("text=New job");
  await page.waitForSelector(".estimate:has-text('requires a token to start a job')");
  assert.equal(await page.locator("dialog[open], .new-job .failure").count(), 0);
  await page.click("button:has-text('Copy as curl')");
  await page.waitForSelector(".new-job .command:has-text('$TOKEN')");
  await page.click("button:has-text('Start')");
  await page.waitForSelector("dialog:has-text('requires a token')");
  assert.deepEqual(await a11yViolations(page), []);
  await page.keyboard.press("Escape");
  await page.waitForSelector(".new-job .failure:has-text('Ask the administrator')");
  await page.click("button:has-text('Start')");
  await page.waitForSelector("dialog:has-text('requires a token')");
  await page.fill("dialog input", "open-says-me-open-says-me");
  await page.keyboard.press("Enter");
  await page.waitForSelector("dialog:has-text('Wrong token')");
  await page.fill("dialog input", token);
  await page.keyboard.press("Enter");
  await page.waitForSelector(".job-detail .chip");
  // The token is stored.
  await page.click(".job-detail button:has-text('Cancel')");
  await untilStatus(page, "cancelled");
  assert.equal(await page.locator("dialog[open]").count(), 0);
  await page.close();
});

test("failed job shows cause and hint", async () => {
  // The job is queued while its mesh is deleted.
  const other = await jobs.startLongJob();
  const mesh = await jobs.uploadMesh();
  const { id } = await jobs.api("jobs", { kind: "mesh.prepare", params: { mesh_id: mesh.id } });
  await fetch(`${jobs.served.address}/api/v1/meshes/${mesh.id}`, { method: "DELETE" });
  await jobs.cancel(other.id);
  assert.equal((await jobs.untilEnded(id)).status, "failed");
  const { page, errors } = await jobs.visit(`#jobs/${id}`);
  await untilStatus(page, "failed");
  const card = await page.textContent(".job-detail .failure");
  assert.match(card, /cannot start the worker.*was deleted.*check the worker executable and the data folder.*launch_failed/);
  assert.match(await page.textContent(`[data-id=${id}]`), /Failed/);
  assert.deepEqual(errors, []);
  await page.close();
});

test("job whose workers are killed shows an alert each time and finally the log", async () => {
  const { id } = await jobs.startLongJob();
  const { page, errors } = await jobs.visit(`#jobs/${id}`);
  const killed = new Set();
  for (const end = Date.now() + TIMEOUT_MS; ; ) {
    const { status, worker } = await jobs.api(`jobs/${id}`);
    if (status === "failed") break;
    assert.ok(Date.now() < end, `${status} after ${killed.size} were killed`);
    if (worker && !killed.has(worker.pid)) {
      process.kill(worker.pid, "SIGKILL");
      killed.add(worker.pid);
    }
    await new Promise((resolve) => setTimeout(resolve, 100));
  }
  await untilStatus(page, "failed");
  await page.waitForSelector(".alerts li:nth-child(6):has-text('worker lost')");
  assert.equal(await page.locator(".alerts li").count(), killed.size);
  await page.waitForSelector(".failure .log-end:has-text('$ ngf evaluate --model planner')");
  await screenshot(page, "job-workers-lost");
  assert.deepEqual(await a11yViolations(page), []);
  assert.deepEqual(errors, []);
  await page.close();
  // Alerts are also shown to a page opened later.
  const { page: later } = await jobs.visit(`#jobs/${id}`);
  await later.waitForSelector(".alerts li:nth-child(6)");
  await later.waitForSelector(".failure .log-end");
  await later.close();
});

test("failed requests are shown near their button and can be retried", async () => {
  await jobs.uploadMesh();
  const { page } = await jobs.visit("#meshes");
  await page.route(/\/api\/v1\/(meshes\/|jobs\?)/, (route) => route.abort());
  await page.click("button:has-text('Delete')");
  await page.waitForSelector("#main-view .failure:has-text('Start one with')");
  await page.selectOption("#filter-kind", { label: "Evaluate policy" });
  await page.waitForSelector("#job-list-end .failure");
  await page.unrouteAll();
  await page.click("#job-list-end button:has-text('Retry')");
  await page.waitForSelector(".row");
  assert.equal(await page.$("#job-list-end .failure"), null);
  await page.click("button:has-text('Delete')");
  await page.waitForSelector("text=No meshes yet.");
  await page.close();
});

test("page catches up after the server was killed and restarted", async () => {
  const { id } = await jobs.api("jobs", { kind: "dataset.generate", params: { preset: "smoke", seed: 77 } });
  const { page } = await jobs.visit(`#jobs/${id}`);
  await page.waitForSelector("[data-state=live]");
  jobs.served.server.kill("SIGKILL");
  await page.waitForSelector("[data-state=lost]");
  // Views that are opened without a server appear once it is back.
  await page.click("text=New job");
  await page.waitForSelector(".new-job .failure:has-text('No job server reachable')");
  const port = new URL(jobs.served.address).port;
  const restarted = await serve({ port, data: join(jobs.folder, "data") });
  jobs.served.server = restarted.server;
  const { close } = jobs.served;
  jobs.served.close = async () => (await close(), restarted.server.kill());
  await page.waitForSelector("[data-state=live]");
  await page.waitForSelector(".new-job [data-param=preset]");
  await page.evaluate((id) => (location.hash = `#jobs/${id}`), id);
  await untilStatus(page, "succeeded");
  await page.close();
});
