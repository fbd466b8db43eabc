// The jobs page where something goes wrong: jobs that fail, answers that are lost, a server that comes and goes.

import assert from "node:assert/strict";
import { writeFileSync } from "node:fs";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { barriers, blank, PATIENCE, screenshot, serve } from "./chromium.js";
import { openJobs, stands, until } from "./jobs.js";

let jobs;
before(async () => (jobs = await openJobs()));
after(() => jobs?.close());

test("a server that does no jobs says what to start", async (t) => {
  const { address, server } = await serve();
  t.after(() => server.kill());
  const { page, complaints } = await blank({ address, browser: jobs.served.browser });
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

test("a deletion that was asked for twice is taken back once, and by whatever else is asked", async () => {
  const { id } = await jobs.long();
  await jobs.stop(id);
  const { page, complaints } = await blank(jobs.served);
  const deletions = [];
  page.on("request", (request) => request.method() === "DELETE" && deletions.push(request.url()));
  await page.clock.install();
  await page.goto(`${jobs.served.address}/jobs/#jobs/${id}`);
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
  const { id } = await jobs.long();
  await jobs.stop(id);
  const { page } = await jobs.visit(`#jobs/${id}`);
  await page.click("button:has-text('Delete')");
  await page.waitForSelector("text=This job will be deleted");
  await page.goto(`${jobs.served.address}/docs/`);
  const status = async () => (await fetch(`${jobs.served.address}/api/v1/jobs/${id}`)).status;
  for (const end = Date.now() + 5000; (await status()) !== 404; ) assert.ok(Date.now() < end, "it is still there");
  await page.close();
});

test("an answer that was lost is asked for again", async () => {
  const { id } = await jobs.long();
  const { page } = await jobs.visit(`#jobs/${id}`);
  await stands(page, "running");
  let asked = 0;
  await page.route(`**/api/v1/jobs/${id}`, (route) => (asked++ < 2 ? route.abort() : route.continue()));
  await jobs.stop(id);
  await stands(page, "cancelled");
  assert.ok(asked > 2, String(asked));
  await page.close();
});

test("a job whose first answer was lost is asked for once", async () => {
  const { page } = await jobs.visit("#new?kind=policy.evaluate&model_id=planner&object=sugar_box&attempts=1&seed=77");
  let lost = 0;
  await page.route("**/api/v1/jobs", async (route) => {
    if (route.request().method() !== "POST" || lost++ > 0) return route.continue();
    await route.fetch();
    return route.abort();
  });
  await page.waitForFunction(() => /It takes about/.test(document.querySelector(".estimate")?.textContent));
  await page.click("button:has-text('Begin')");
  await page.waitForSelector(".new-job .failure");
  await page.click("button:has-text('Begin')");
  await page.waitForSelector(".detail-job");
  const { data } = await jobs.api("jobs?kind=policy.evaluate");
  assert.equal(data.filter(({ params }) => params.seed === 77).length, 1);
  await page.close();
});

test("a comparison shows how its jobs stand", async () => {
  const ids = [];
  for (const name of ["one", "another"]) ids.push((await jobs.long({}, name)).id);
  const { page } = await jobs.visit(`#compare/${ids.join(",")}`);
  await page.waitForSelector("#detail .legend .is-running");
  for (const id of ids) await jobs.stop(id);
  await page.waitForFunction(() => document.querySelectorAll("#detail .legend .is-cancelled").length === 2);
  await page.close();
});

test("an answer that was overtaken does not stay", async () => {
  const { id } = await jobs.long();
  const { page } = await jobs.visit(`#jobs/${id}`);
  await stands(page, "running");
  let [asked, late] = [0, null];
  await page.route(`**/api/v1/jobs/${id}`, async (route) => {
    asked += 1;
    if (asked > 1) return route.continue();
    const answer = await route.fetch();
    late = () => route.fulfill({ response: answer });
  });
  await jobs.api(`jobs/${id}/pause`, {});
  await until(() => late);
  await jobs.stop(id);
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
    ids.push((await jobs.long({}, name)).id);
    await jobs.stop(ids.at(-1));
  }
  await fetch(`${jobs.served.address}/api/v1/jobs/${ids[1]}`, { method: "DELETE" });
  const { page } = await jobs.visit(`#compare/${ids.join(",")}`);
  await page.waitForSelector("#detail .legend:has-text('the one that stays')");
  assert.match(await page.textContent("#detail .failure"), new RegExp(ids[1]));
  assert.equal(await page.locator("#detail .legend li").count(), 1);
  await page.close();
});

test("a server with a token asks for it, and takes no other", async (t) => {
  const [token, tokenFile] = ["open-sesame-open-sesame", join(jobs.folder, "token")];
  writeFileSync(tokenFile, token);
  const { address, server } = await serve({ data: join(jobs.folder, "guarded"), tokenFile });
  t.after(() => server.kill());
  const { page } = await blank({ address, browser: jobs.served.browser });
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
  const other = await jobs.long();
  const mesh = await jobs.uploaded();
  const { id } = await jobs.api("jobs", { kind: "mesh.prepare", params: { mesh_id: mesh.id } });
  await fetch(`${jobs.served.address}/api/v1/meshes/${mesh.id}`, { method: "DELETE" });
  await jobs.stop(other.id);
  assert.equal((await jobs.over(id)).status, "failed");
  const { page, complaints } = await jobs.visit(`#jobs/${id}`);
  await stands(page, "failed");
  const card = await page.textContent(".detail-job .failure");
  assert.match(card, /could not be started.*was deleted.*look at the program and the data folder.*launch_failed/);
  assert.match(await page.textContent(`[data-id=${id}]`), /failed/);
  assert.deepEqual(complaints, []);
  await page.close();
});

test("a job whose processes vanish says so each time, and at last what they said", async () => {
  const { id } = await jobs.long();
  const { page, complaints } = await jobs.visit(`#jobs/${id}`);
  const killed = new Set();
  for (const end = Date.now() + PATIENCE; ; ) {
    const { status, worker } = await jobs.api(`jobs/${id}`);
    if (status === "failed") break;
    assert.ok(Date.now() < end, `${status} after ${killed.size} were killed`);
    if (worker && !killed.has(worker.pid)) {
      process.kill(worker.pid, "SIGKILL");
      killed.add(worker.pid);
    }
    await new Promise((resolve) => setTimeout(resolve, 100));
  }
  await stands(page, "failed");
  await page.waitForSelector(".alerts li:nth-child(6):has-text('its process vanished')");
  assert.equal(await page.locator(".alerts li").count(), killed.size);
  await page.waitForSelector(".failure .log-end:has-text('$ ngf evaluate --model planner')");
  await screenshot(page, "job-vanished");
  assert.deepEqual(await barriers(page), []);
  assert.deepEqual(complaints, []);
  await page.close();
  // Whoever comes later is told the same.
  const { page: later } = await jobs.visit(`#jobs/${id}`);
  await later.waitForSelector(".alerts li:nth-child(6)");
  await later.waitForSelector(".failure .log-end");
  await later.close();
});

test("what cannot be asked for is told there, and tried again", async () => {
  await jobs.uploaded();
  const { page } = await jobs.visit("#meshes");
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
  const { id } = await jobs.api("jobs", { kind: "dataset.generate", params: { preset: "smoke", seed: 77 } });
  const { page } = await jobs.visit(`#jobs/${id}`);
  await page.waitForSelector("[data-state=live]");
  jobs.served.server.kill("SIGKILL");
  await page.waitForSelector("[data-state=lost]");
  const port = new URL(jobs.served.address).port;
  const again = await serve({ port, data: join(jobs.folder, "data") });
  jobs.served.server = again.server;
  const { close } = jobs.served;
  jobs.served.close = async () => (await close(), again.server.kill());
  await page.waitForSelector("[data-state=live]");
  await stands(page, "succeeded");
  await page.close();
});
