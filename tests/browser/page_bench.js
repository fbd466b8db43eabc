// Page benchmark for `cargo xtask bench`: download size, load times and interaction latency.

import { newPage, open, untilReady, visit } from "./chromium.js";
import { bottle } from "./meshes.js";

// Number of visits; rows are medians.
const VISITS = 5;
// Triangles of the uploaded mesh.
const TRIANGLES = 20_000;
// Interval between key presses (ms).
const KEY_INTERVAL = 100;

function quantile(fraction, values) {
  const sorted = values.toSorted((a, b) => a - b);
  return sorted[Math.min(Math.floor(fraction * sorted.length), sorted.length - 1)];
}

function row(name, value, unit) {
  console.log(`row ${name} ${value.toFixed(3)} ${unit}`);
}

// Runs in the page before its scripts: records when the first frame is submitted, when its pixels are available
// (later with software rendering), and the duration of interactions.
function recordTimes() {
  globalThis.interactions = new Map();
  new PerformanceObserver((list) => {
    for (const { interactionId, duration } of list.getEntries()) {
      if (interactionId > 0) globalThis.interactions.set(interactionId, Math.max(duration, globalThis.interactions.get(interactionId) ?? 0));
    }
  }).observe({ type: "event", durationThreshold: 16, buffered: true });
  new MutationObserver(() => {
    const view = document.getElementById("view");
    if (globalThis.firstFrame || !(Number(view?.dataset.drawn) > 0)) return;
    globalThis.firstFrame = performance.now();
    const gl = view.getContext("webgl2");
    // Reading one pixel waits for the whole frame.
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
    globalThis.firstPixels = performance.now();
  }).observe(document, { subtree: true, childList: true, attributes: true, attributeFilter: ["data-drawn"] });
}

async function load(page, address) {
  await page.goto(address);
  await page.waitForFunction(() => globalThis.firstFrame !== undefined);
  const [frame, pixels] = await page.evaluate(() => [globalThis.firstFrame, globalThis.firstPixels]);
  await untilReady(page);
  return { frame, pixels, ready: await page.evaluate(() => performance.now()) };
}

// Load times of first and second visits, and the compressed size of the code of the first visit: HTML, scripts, styles
// and WebAssembly, without fonts, model and recording.
async function visits(served) {
  const firsts = [];
  const seconds = [];
  let code = 0;
  for (let i = 0; i < VISITS; i++) {
    const context = await served.browser.newContext();
    const page = await context.newPage();
    await page.addInitScript(recordTimes);
    const fetched = [];
    const isCode = (response) => /(\/|\.js|\.css|\.wasm|\.html)$/.test(new URL(response.url()).pathname);
    page.on("response", (response) => isCode(response) && fetched.push(response.request().sizes()));
    firsts.push(await load(page, served.address));
    if (i === 0) for (const { responseBodySize } of await Promise.all(fetched)) code += responseBodySize;
    seconds.push(await load(page, served.address));
    await context.close();
  }
  row("page_first_frame", quantile(0.5, firsts.map(({ frame }) => frame)), "ms");
  row("page_first_pixels", quantile(0.5, firsts.map(({ pixels }) => pixels)), "ms");
  row("page_ready", quantile(0.5, firsts.map(({ ready }) => ready)), "ms");
  row("page_second_frame", quantile(0.5, seconds.map(({ frame }) => frame)), "ms");
  row("page_second_pixels", quantile(0.5, seconds.map(({ pixels }) => pixels)), "ms");
  row("page_second_ready", quantile(0.5, seconds.map(({ ready }) => ready)), "ms");
  row("page_code", code / 1e6, "MB");
}

// Frame rate, real-time factor at speed 1x, and interaction latency while an attempt runs.
async function responsiveness(served) {
  const { page } = await newPage(served, { pixelRatio: 1 });
  await page.addInitScript(recordTimes);
  await load(page, served.address);
  await page.click("#grasp");
  await page.waitForSelector("[data-phase=policy].is-now");
  await page.evaluate(() => {
    globalThis.frames = 0;
    const count = (changes) => (globalThis.frames += changes.length);
    new MutationObserver(count).observe(document.getElementById("view"), { attributeFilter: ["data-drawn"] });
  });
  const start = performance.now();
  const rates = [];
  for (const key of "cmhfpxcmhfpxcmhfpxcmhfpxcmhfpxcmhfpx") {
    await page.keyboard.press(key);
    await page.waitForTimeout(KEY_INTERVAL);
    const rate = parseFloat(await page.textContent("#rate"));
    if (Number.isFinite(rate)) rates.push(rate);
  }
  row("page_frames", (1_000 * (await page.evaluate(() => globalThis.frames))) / (performance.now() - start), "/s");
  row("page_real_time_factor", quantile(0.5, rates), "x");
  // The browser does not report interactions below 16 ms; they count as 16 ms.
  row("page_interaction_p95", quantile(0.95, await page.evaluate(() => [...globalThis.interactions.values(), 16])), "ms");
  await page.close();
}

// Time from the upload of a mesh to the outcome of an attempt, at maximum speed.
async function upload(served) {
  const { page } = await visit(served, { pixelRatio: 1 });
  await untilReady(page);
  await page.selectOption("#speed", "4");
  const file = { name: "bottle.obj", mimeType: "text/plain", buffer: Buffer.from(bottle(TRIANGLES)) };
  const start = performance.now();
  await page.setInputFiles("#file", file);
  await page.waitForFunction(() => document.getElementById("info-mesh").textContent.includes("20,000"));
  await untilReady(page);
  row("page_upload", performance.now() - start, "ms");
  await page.click("#grasp");
  await page.waitForSelector("[data-phase=outcome].is-now");
  row("page_upload_to_outcome", performance.now() - start, "ms");
  await page.close();
}

const served = await open();
try {
  await visits(served);
  await responsiveness(served);
  await upload(served);
} finally {
  await served.close();
}
