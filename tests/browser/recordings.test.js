// Saved images and videos, meshes on the server, and offline use.

import assert from "node:assert/strict";
import { mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { newPage, open, untilReady, visit } from "./chromium.js";
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

// Name and bytes of the file that a click downloads.
async function downloadBy(page, selector) {
  const [download] = await Promise.all([page.waitForEvent("download"), page.click(selector)]);
  return { name: download.suggestedFilename(), bytes: readFileSync(await download.path()) };
}

async function runAttempt(page) {
  await page.click("#grasp");
  await page.waitForSelector("[data-phase=approach].is-now");
  await page.waitForSelector("[data-phase=outcome].is-now");
  return { headline: await page.textContent("#headline"), hash: await page.getAttribute("#hash", "title") };
}

test("saved image shows the canvas, and saved video is a WebM or MP4 file", async () => {
  const { page, errors } = await visit(served);
  await untilReady(page);
  const image = await downloadBy(page, "#save-png");
  assert.equal(image.name, "ngf-grasp.png");
  assert.equal(image.bytes.subarray(1, 4).toString(), "PNG");
  // Aspect ratio of the view, and more than one color.
  const shown = await page.evaluate(async (base64) => {
    const decoded = new Image();
    decoded.src = `data:image/png;base64,${base64}`;
    await decoded.decode();
    const canvas = Object.assign(document.createElement("canvas"), { width: decoded.width, height: decoded.height });
    const context = canvas.getContext("2d");
    context.drawImage(decoded, 0, 0);
    const colors = new Set(new Uint32Array(context.getImageData(0, 0, decoded.width, decoded.height).data.buffer));
    const view = document.getElementById("view");
    return { ratio: decoded.width / decoded.height - view.clientWidth / view.clientHeight, colors: colors.size };
  }, image.bytes.toString("base64"));
  assert.ok(Math.abs(shown.ratio) < 0.01 && shown.colors > 200, JSON.stringify(shown));

  await page.click("#save-webm");
  await page.waitForFunction(() => document.getElementById("save-webm").textContent === "Stop");
  await page.click("#grasp");
  await page.waitForTimeout(2_000);
  const video = await downloadBy(page, "#save-webm");
  assert.match(video.name, /^ngf-grasp\.(webm|mp4)$/);
  assert.ok(video.bytes.length > 10_000, `${video.bytes.length} bytes`);
  if (video.name.endsWith("webm")) assert.deepEqual([...video.bytes.subarray(0, 4)], [0x1a, 0x45, 0xdf, 0xa3]);
  assert.equal(await page.textContent("#save-webm"), "Video");

  // After an outcome nothing moves, so the attempt is played again. The film plays outside of the page's policy.
  await page.selectOption("#speed", "4");
  await page.waitForSelector("[data-phase=outcome].is-now");
  await page.waitForTimeout(1_000);
  await page.click("#save-webm");
  await page.waitForSelector("[data-phase=approach].is-now");
  await page.waitForTimeout(4_000);
  const film = await downloadBy(page, "#save-webm");
  assert.ok(film.bytes.length > 10_000, `${film.bytes.length} bytes`);
  const player = await served.browser.newPage();
  const source = `data:video/${film.name.split(".").pop()};base64,${film.bytes.toString("base64")}`;
  const played = await player.evaluate(async (source) => {
    const video = Object.assign(document.createElement("video"), { src: source, muted: true });
    document.body.append(video);
    await video.play();
    await new Promise((resolve) => setTimeout(resolve, 1_000));
    return { time: video.currentTime, width: video.videoWidth };
  }, source);
  assert.ok(played.time > 0.5 && played.width > 100, JSON.stringify(played));
  await player.close();
  assert.deepEqual(errors, []);
  await page.close();
});

test("mesh stored on the server is included in the share link", async () => {
  const context = await served.browser.newContext({ permissions: ["clipboard-read", "clipboard-write"], reducedMotion: "reduce" });
  const page = await context.newPage();
  await page.goto(served.address);
  await untilReady(page);
  await page.setInputFiles("#file", { name: "tea.obj", mimeType: "text/plain", buffer: Buffer.from(BOX) });
  await page.waitForFunction(() => document.body.textContent.includes("tea.obj"));
  const { headline, hash } = await runAttempt(page);
  await page.click("#copy-link");
  await page.waitForFunction(() => /need the mesh file/.test(document.getElementById("share-hint").textContent));
  const linkWithoutMesh = await page.evaluate(() => navigator.clipboard.readText());
  await page.click("#store");
  await page.waitForFunction(() => document.getElementById("share-hint").textContent === "Copied.");
  assert.ok(await page.isHidden("#store"));
  const link = await page.evaluate(() => navigator.clipboard.readText());
  assert.notEqual(link, linkWithoutMesh);
  await context.close();

  const { page: other, errors } = await newPage(served);
  await other.goto(link);
  await other.waitForFunction(() => document.getElementById("hash").textContent.endsWith("(matches the link)"));
  assert.equal(await other.getAttribute("#hash", "title"), hash);
  assert.equal(await other.textContent("#headline"), headline);
  assert.deepEqual(errors, []);
  await other.close();
});

test("mesh of the URL loads with a progress bar and does not replace an object selected meanwhile", async () => {
  const response = await fetch(`${served.address}/api/v1/meshes?name=late.obj`, { method: "POST", body: BOX.replaceAll("120", "90") });
  const { id } = await response.json();
  const { page, errors } = await newPage(served);
  // Delivers the file byte by byte until released. A Playwright route cannot stream, so `fetch` is replaced.
  await page.addInitScript(() => {
    const originalFetch = globalThis.fetch;
    globalThis.fetch = async (...args) => {
      const response = await originalFetch(...args);
      if (!/meshes.*file/.test(String(args[0]))) return response;
      const bytes = new Uint8Array(await response.arrayBuffer());
      const body = new ReadableStream({
        async start(stream) {
          let at = 0;
          for (; !globalThis.isReleased && at < bytes.length; at += 1) {
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
  await page.waitForFunction(() => document.getElementById("info-mass").textContent === "349 g");
  await page.evaluate(() => (globalThis.isReleased = true));
  await page.waitForSelector("#objects label:has-text('late.obj')");
  await page.waitForSelector("#progress", { state: "hidden" });
  // The response to this later request would follow a change of the object.
  const before = await page.inputValue("#pose-x");
  await page.click("#new-pose");
  await page.waitForFunction((x) => document.getElementById("pose-x").value !== x, before);
  assert.ok(await page.isChecked("#objects [value=soup_can]"));
  assert.equal(await page.textContent("#info-mass"), "349 g");
  await page.click("#objects label:has-text('late.obj')");
  await page.waitForFunction(() => document.getElementById("info-mass").textContent !== "349 g");
  assert.deepEqual(errors, []);
  await page.close();
});

test("loaded demo works offline and reports policies that cannot be downloaded", async () => {
  const context = await served.browser.newContext({ reducedMotion: "reduce" });
  const page = await context.newPage();
  await page.goto(served.address);
  await untilReady(page);
  await page.waitForFunction(() => /^Loaded: /.test(document.getElementById("model").textContent));
  await page.focus("#compare");
  await page.waitForSelector("#compare option[value=ycb-two]", { state: "attached" });
  await page.focus("#policy");
  await page.waitForSelector("#policy option[value=ycb-two]", { state: "attached" });
  await context.setOffline(true);
  await page.waitForSelector("[data-code=offline]");
  await page.setInputFiles("#file", { name: "tea.obj", mimeType: "text/plain", buffer: Buffer.from(BOX) });
  await page.waitForFunction(() => document.body.textContent.includes("tea.obj"));
  const { headline } = await runAttempt(page);
  assert.match(headline, /\.$/);
  await page.selectOption("#compare", "ycb-two");
  await page.waitForSelector("[data-code=second_model_download_failed]");
  assert.ok(await page.isEnabled("#grasp"));
  await page.selectOption("#policy", "ycb-two");
  await page.click("[data-code=model_download_failed] .retry");
  await page.waitForSelector("[data-code=model_download_failed] .retry");
  await context.setOffline(false);
  await page.waitForSelector("[data-code=offline]", { state: "detached" });
  await page.click("[data-code=model_download_failed] .retry");
  await page.waitForFunction(() => /^Loaded: ycb-two$/.test(document.getElementById("model").textContent));
  assert.equal(await page.locator("[data-code=model_download_failed]").count(), 0);
  await context.close();
});
