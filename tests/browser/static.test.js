// The page on a static host, in a subfolder, without `ngf serve`.

import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { createReadStream, existsSync, statSync } from "node:fs";
import { createServer } from "node:http";
import { extname, join } from "node:path";
import { after, before, test } from "node:test";
import { newPage, launch, root, untilReady } from "./chromium.js";

const TYPES = { ".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".wasm": "application/wasm", ".json": "application/json" };
const FOLDER = "/some/folder";

// Respond to unknown paths with index.html, as hosts of single-page applications do.
let hasFallback = false;
let server;
let browser;
let address;
before(async () => {
  server = createServer(({ url }, response) => {
    const path = new URL(url, "http://host").pathname;
    let file = join(`${root}web/dist`, path.slice(FOLDER.length));
    if (path.startsWith(FOLDER) && existsSync(file) && statSync(file).isDirectory()) file = join(file, "index.html");
    if (!path.startsWith(FOLDER) || !existsSync(file)) {
      if (!hasFallback) return response.writeHead(404).end("not found");
      file = join(`${root}web/dist`, "index.html");
    }
    response.writeHead(200, { "Content-Type": TYPES[extname(file)] ?? "application/octet-stream" });
    createReadStream(file).pipe(response);
  });
  await new Promise((resolve) => server.listen(0, "127.0.0.1", resolve));
  address = `http://127.0.0.1:${server.address().port}${FOLDER}/`;
  browser = await launch();
});
after(async () => {
  await browser?.close();
  server?.close();
});

test("demo runs on a static host, and the other pages name the command to start", async () => {
  const { page, errors } = await newPage({ address, browser });
  await page.goto(address);
  await untilReady(page);
  assert.equal(await page.textContent("#model"), "Loaded: default");
  await page.selectOption("#speed", "4");
  await page.click("#grasp");
  await page.waitForSelector("[data-phase=outcome].is-now");
  // The requests of model and list of models to a server may fail with 404.
  assert.ok(errors.length <= 2 && errors.every((text) => text.includes("404")), errors.join());
  // The host sends no isolation headers, which are optional.
  await page.click("#check-open");
  assert.equal(await page.textContent("dialog.check h2"), "Supported; 1 optional feature missing");
  assert.equal(await page.locator("dialog.check .is-bad").count(), 0);
  assert.equal(await page.textContent("dialog.check .is-optional code"), "ngf serve");
  for (const path of ["jobs/", "docs/"]) {
    await page.goto(address + path);
    const card = await page.waitForSelector(".failure");
    assert.match(await card.textContent(), /Start one with ngf serve --data-dir DIR/, path);
  }
  await page.close();
});

test("host with a fallback page is not taken for a job server", async (t) => {
  hasFallback = true;
  t.after(() => (hasFallback = false));
  const { page, errors } = await newPage({ address, browser });
  await page.goto(address);
  await untilReady(page);
  assert.equal(await page.textContent("#model"), "Loaded: default");
  await page.focus("#policy");
  await page.waitForSelector("#policy option[value=mlp-pcd]", { state: "attached" });
  assert.deepEqual(errors, []);
  for (const path of ["jobs/", "docs/"]) {
    await page.goto(address + path);
    const card = await page.waitForSelector(".failure");
    assert.match(await card.textContent(), /Start one with ngf serve --data-dir DIR/, path);
  }
  await page.close();
});

test("jobs page of the preview says that the server is being built, and reloads when it responds", async () => {
  const vite = spawn(process.execPath, ["node_modules/vite/bin/vite.js", "preview", "--host", "127.0.0.1", "--port", "0"], {
    cwd: `${root}web`,
    env: { ...process.env, NGF_PENDING_SERVER: "1", NO_COLOR: "1" },
  });
  try {
    const address = await new Promise((resolve) => {
      vite.stdout.on("data", (text) => /http:\S+/.test(text) && resolve(/http:\S+/.exec(text)[0]));
    });
    const { page } = await newPage({ address, browser });
    await page.goto(`${address}jobs/`);
    const card = await page.waitForSelector(".failure");
    assert.match(await card.textContent(), /The job server is being built.*reloads when the server is ready/s);
    const reload = page.waitForNavigation();
    await page.route("**/api/v1", (route) => route.fulfill({ json: {} }));
    await reload;
    await page.close();
  } finally {
    vite.kill();
  }
});
