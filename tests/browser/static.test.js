// The page without any server of ours: files alone, in a folder of some host.

import assert from "node:assert/strict";
import { createReadStream, existsSync, statSync } from "node:fs";
import { createServer } from "node:http";
import { extname, join } from "node:path";
import { after, before, test } from "node:test";
import { blank, launch, root, untilReady } from "./chromium.js";

const TYPES = { ".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".wasm": "application/wasm", ".json": "application/json" };
const FOLDER = "/some/folder";

// What is not there is answered with the page, as hosts of single-page applications do.
let answersAll = false;
let server;
let browser;
let address;
before(async () => {
  server = createServer(({ url }, answer) => {
    const path = new URL(url, "http://host").pathname;
    let file = join(`${root}web/dist`, path.slice(FOLDER.length));
    if (path.startsWith(FOLDER) && existsSync(file) && statSync(file).isDirectory()) file = join(file, "index.html");
    if (!path.startsWith(FOLDER) || !existsSync(file)) {
      if (!answersAll) return answer.writeHead(404).end("not here");
      file = join(`${root}web/dist`, "index.html");
    }
    answer.writeHead(200, { "Content-Type": TYPES[extname(file)] ?? "application/octet-stream" });
    createReadStream(file).pipe(answer);
  });
  await new Promise((resolve) => server.listen(0, "127.0.0.1", resolve));
  address = `http://127.0.0.1:${server.address().port}${FOLDER}/`;
  browser = await launch();
});
after(async () => {
  await browser?.close();
  server?.close();
});

test("the demo runs, and the other pages say what to start", async () => {
  const { page, complaints } = await blank({ address, browser });
  await page.goto(address);
  await untilReady(page);
  assert.equal(await page.textContent("#model"), 'Policy "default" acts.');
  await page.selectOption("#speed", "4");
  await page.click("#grasp");
  await page.waitForSelector("[data-phase=verdict].is-now");
  // Whether there is a server can only be found out by asking.
  assert.ok(complaints.length <= 1 && complaints.every((text) => text.includes("404")), complaints.join());
  for (const path of ["jobs/", "docs/"]) {
    await page.goto(address + path);
    const card = await page.waitForSelector(".failure");
    assert.match(await card.textContent(), /Start one with .ngf serve --data DIR/, path);
  }
  await page.close();
});

test("a host that answers everything with a page is no server of jobs", async (t) => {
  answersAll = true;
  t.after(() => (answersAll = false));
  const { page, complaints } = await blank({ address, browser });
  await page.goto(address);
  await untilReady(page);
  assert.equal(await page.textContent("#model"), 'Policy "default" acts.');
  await page.focus("#policy");
  await page.waitForSelector("#policy option[value=mlp-pcd]", { state: "attached" });
  assert.deepEqual(complaints, []);
  for (const path of ["jobs/", "docs/"]) {
    await page.goto(address + path);
    const card = await page.waitForSelector(".failure");
    assert.match(await card.textContent(), /Start one with .ngf serve --data DIR/, path);
  }
  await page.close();
});
