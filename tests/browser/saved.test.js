// What is saved and kept: pictures, films, a file on the server; and a page without graphics, or without a network.

import assert from "node:assert/strict";
import { mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { blank, open, untilReady, visit } from "./chromium.js";
import { BOX } from "./meshes.js";

let served;
let data;
before(async () => {
  data = mkdtempSync(join(tmpdir(), "ngf-"));
  served = await open({ data });
});
after(async () => {
  await served?.close();
  rmSync(data, { recursive: true, force: true });
});

// The bytes of what a click saves, and its name.
async function savedBy(page, selector) {
  const [download] = await Promise.all([page.waitForEvent("download"), page.click(selector)]);
  return { name: download.suggestedFilename(), bytes: readFileSync(await download.path()) };
}

async function verdict(page) {
  await page.click("#grasp");
  await page.waitForSelector("[data-phase=approach].is-now");
  await page.waitForSelector("[data-phase=verdict].is-now");
  return { words: await page.textContent("#headline"), hash: await page.getAttribute("#hash", "title") };
}

test("a picture is a picture of the canvas, and a film is a film", async () => {
  const { page, complaints } = await visit(served);
  await untilReady(page);
  const picture = await savedBy(page, "#save-png");
  assert.equal(picture.name, "ngf-grasp.png");
  assert.equal(picture.bytes.subarray(1, 4).toString(), "PNG");
  // Its size, and that it is not of one colour.
  const shown = await page.evaluate(async (base64) => {
    const image = new Image();
    image.src = `data:image/png;base64,${base64}`;
    await image.decode();
    const canvas = Object.assign(document.createElement("canvas"), { width: image.width, height: image.height });
    const context = canvas.getContext("2d");
    context.drawImage(image, 0, 0);
    const colors = new Set(new Uint32Array(context.getImageData(0, 0, image.width, image.height).data.buffer));
    const view = document.getElementById("view");
    return { ratio: image.width / image.height - view.clientWidth / view.clientHeight, colors: colors.size };
  }, picture.bytes.toString("base64"));
  assert.ok(Math.abs(shown.ratio) < 0.01 && shown.colors > 200, JSON.stringify(shown));

  await page.click("#save-webm");
  await page.waitForFunction(() => document.getElementById("save-webm").textContent === "Stop");
  await page.click("#grasp");
  await page.waitForTimeout(2_000);
  const film = await savedBy(page, "#save-webm");
  assert.match(film.name, /^ngf-grasp\.(webm|mp4)$/);
  assert.ok(film.bytes.length > 10_000, `${film.bytes.length} bytes`);
  if (film.name.endsWith("webm")) assert.deepEqual([...film.bytes.subarray(0, 4)], [0x1a, 0x45, 0xdf, 0xa3]);
  assert.equal(await page.textContent("#save-webm"), "Film");
  assert.deepEqual(complaints, []);
  await page.close();
});

test("a file that is kept on the server comes with the link", async () => {
  const context = await served.browser.newContext({ permissions: ["clipboard-read", "clipboard-write"], reducedMotion: "reduce" });
  const page = await context.newPage();
  await page.goto(served.address);
  await untilReady(page);
  await page.setInputFiles("#file", { name: "tea.obj", mimeType: "text/plain", buffer: Buffer.from(BOX) });
  await page.waitForFunction(() => document.body.textContent.includes("tea.obj"));
  const { words, hash } = await verdict(page);
  await page.click("#copy-link");
  await page.waitForFunction(() => /need the file/.test(document.getElementById("share-hint").textContent));
  const bare = await page.evaluate(() => navigator.clipboard.readText());
  await page.click("#store");
  await page.waitForFunction(() => document.getElementById("share-hint").textContent === "Copied.");
  assert.ok(await page.isHidden("#store"));
  const link = await page.evaluate(() => navigator.clipboard.readText());
  assert.notEqual(link, bare);
  await context.close();

  const { page: other, complaints } = await blank(served);
  await other.goto(link);
  await other.waitForFunction(() => document.getElementById("hash").textContent.endsWith("as in the link"));
  assert.equal(await other.getAttribute("#hash", "title"), hash);
  assert.equal(await other.textContent("#headline"), words);
  assert.deepEqual(complaints, []);
  await other.close();
});

test("what the address asks for is on its way with a bar, and does not take the place of what somebody began", async () => {
  const asked = await fetch(`${served.address}/api/v1/meshes?name=late.obj`, { method: "POST", body: BOX.replaceAll("120", "90") });
  const { id } = await asked.json();
  const { page, complaints } = await blank(served);
  // It drips until it may come. A route answers as a whole, so that the page's own fetch is taken in hand.
  await page.addInitScript(() => {
    const fetched = globalThis.fetch;
    globalThis.fetch = async (...asked) => {
      const answer = await fetched(...asked);
      if (!/meshes.*file/.test(String(asked[0]))) return answer;
      const bytes = new Uint8Array(await answer.arrayBuffer());
      const body = new ReadableStream({
        async start(stream) {
          let at = 0;
          for (; !globalThis.mayCome && at < bytes.length; at += 1) {
            stream.enqueue(bytes.slice(at, at + 1));
            await new Promise((resolve) => setTimeout(resolve, 200));
          }
          stream.enqueue(bytes.slice(at));
          stream.close();
        },
      });
      return new Response(body, { headers: { "Content-Length": String(bytes.length) } });
    };
  });
  await page.goto(`${served.address}/?mesh=${id}`);
  await untilReady(page);
  await page.waitForFunction(() => /^late\.obj /.test(document.getElementById("progress-label").textContent));
  await page.click("#objects label:has([value=soup_can])");
  await page.waitForFunction(() => document.getElementById("report-mass").textContent === "349 g");
  await page.evaluate(() => (globalThis.mayCome = true));
  await page.waitForSelector("#objects label:has-text('late.obj')");
  await page.waitForSelector("#progress", { state: "hidden" });
  // What the worker says to a later question would come after another object.
  const before = await page.inputValue("#pose-x");
  await page.click("#new-pose");
  await page.waitForFunction((x) => document.getElementById("pose-x").value !== x, before);
  assert.ok(await page.isChecked("#objects [value=soup_can]"));
  assert.equal(await page.textContent("#report-mass"), "349 g");
  await page.click("#objects label:has-text('late.obj')");
  await page.waitForFunction(() => document.getElementById("report-mass").textContent !== "349 g");
  assert.deepEqual(complaints, []);
  await page.close();
});

test("what is loaded goes on without a network, and what is not says so", async () => {
  const context = await served.browser.newContext({ reducedMotion: "reduce" });
  const page = await context.newPage();
  await page.goto(served.address);
  await untilReady(page);
  await page.waitForFunction(() => /Policy "/.test(document.getElementById("model").textContent));
  await page.focus("#compare");
  await page.waitForSelector("#compare option[value=paper]", { state: "attached" });
  await page.focus("#policy");
  await page.waitForSelector("#policy option[value=paper]", { state: "attached" });
  await context.setOffline(true);
  await page.waitForSelector("[data-code=offline]");
  await page.setInputFiles("#file", { name: "tea.obj", mimeType: "text/plain", buffer: Buffer.from(BOX) });
  await page.waitForFunction(() => document.body.textContent.includes("tea.obj"));
  const { words } = await verdict(page);
  assert.match(words, /\.$/);
  await page.selectOption("#compare", "paper");
  await page.waitForSelector("[data-code=second_model_not_fetched]");
  assert.ok(await page.isEnabled("#grasp"));
  await page.selectOption("#policy", "paper");
  await page.click("[data-code=model_not_fetched] .again");
  await page.waitForSelector("[data-code=model_not_fetched] .again");
  await context.setOffline(false);
  await page.waitForSelector("[data-code=offline]", { state: "detached" });
  await page.click("[data-code=model_not_fetched] .again");
  await page.waitForFunction(() => /Policy "paper"/.test(document.getElementById("model").textContent));
  assert.equal(await page.locator("[data-code=model_not_fetched]").count(), 0);
  await context.close();
});
