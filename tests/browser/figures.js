// What the page takes, as rows for `cargo xtask bench`: bytes, and milliseconds as somebody before it waits them.

import { blank, open, untilReady, visit } from "./chromium.js";
import { bottle } from "./meshes.js";

// Visits of which the median counts.
const VISITS = 5;
// Triangles of the mesh that is brought.
const TRIANGLES = 20_000;
// Milliseconds from key to key.
const PACE = 100;

function at(share, values) {
  const sorted = values.toSorted((a, b) => a - b);
  return sorted[Math.min(Math.floor(share * sorted.length), sorted.length - 1)];
}

function row(name, value, unit) {
  console.log(`row ${name} ${value.toFixed(3)} ${unit}`);
}

// Runs in the page before all else: notes when the first picture is the graphics' to make, when its pixels are there,
// which where the processor draws is later, and what interactions took.
function watch() {
  globalThis.interactions = new Map();
  new PerformanceObserver((list) => {
    for (const { interactionId, duration } of list.getEntries()) {
      if (interactionId > 0) globalThis.interactions.set(interactionId, Math.max(duration, globalThis.interactions.get(interactionId) ?? 0));
    }
  }).observe({ type: "event", durationThreshold: 16, buffered: true });
  new MutationObserver(() => {
    const view = document.getElementById("view");
    if (globalThis.pictured || !(Number(view?.dataset.drawn) > 0)) return;
    globalThis.pictured = performance.now();
    const gl = view.getContext("webgl2");
    // Reading one waits for all.
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
    globalThis.pixels = performance.now();
  }).observe(document, { subtree: true, childList: true, attributes: true, attributeFilter: ["data-drawn"] });
}

async function arrive(page, address) {
  await page.goto(address);
  await page.waitForFunction(() => globalThis.pictured !== undefined);
  const [picture, pixels] = await page.evaluate(() => [globalThis.pictured, globalThis.pixels]);
  await untilReady(page);
  return { picture, pixels, ready: await page.evaluate(() => performance.now()) };
}

// First and second visits, and the code that the first one fetches, as it is sent, compressed: without fonts, the
// recording that is played at once, and the model.
async function visits(served) {
  const firsts = [];
  const seconds = [];
  let code = 0;
  for (let i = 0; i < VISITS; i++) {
    const context = await served.browser.newContext();
    const page = await context.newPage();
    await page.addInitScript(watch);
    const fetched = [];
    const isCode = (response) => /(\/|\.js|\.css|\.wasm|\.html)$/.test(new URL(response.url()).pathname);
    page.on("response", (response) => isCode(response) && fetched.push(response.request().sizes()));
    firsts.push(await arrive(page, served.address));
    if (i === 0) for (const { responseBodySize } of await Promise.all(fetched)) code += responseBodySize;
    seconds.push(await arrive(page, served.address));
    await context.close();
  }
  row("page_first_picture", at(0.5, firsts.map(({ picture }) => picture)), "ms");
  row("page_first_pixels", at(0.5, firsts.map(({ pixels }) => pixels)), "ms");
  row("page_ready", at(0.5, firsts.map(({ ready }) => ready)), "ms");
  row("page_second_picture", at(0.5, seconds.map(({ picture }) => picture)), "ms");
  row("page_second_pixels", at(0.5, seconds.map(({ pixels }) => pixels)), "ms");
  row("page_second_ready", at(0.5, seconds.map(({ ready }) => ready)), "ms");
  row("page_code", code / 1e6, "MB");
}

// How fast the simulation goes at 1x while it is drawn, and how soon the page answers meanwhile.
async function liveliness(served) {
  const { page } = await blank(served);
  await page.addInitScript(watch);
  await arrive(page, served.address);
  await page.click("#grasp");
  await page.waitForSelector("[data-phase=policy].is-now");
  await page.evaluate(() => {
    globalThis.pictures = 0;
    const count = (drawn) => (globalThis.pictures += drawn.length);
    new MutationObserver(count).observe(document.getElementById("view"), { attributeFilter: ["data-drawn"] });
  });
  const began = performance.now();
  const rates = [];
  for (const key of "cmhfpxcmhfpxcmhfpxcmhfpxcmhfpxcmhfpx") {
    await page.keyboard.press(key);
    await page.waitForTimeout(PACE);
    const rate = parseFloat(await page.textContent("#rate"));
    if (Number.isFinite(rate)) rates.push(rate);
  }
  row("page_pictures", (1_000 * (await page.evaluate(() => globalThis.pictures))) / (performance.now() - began), "/s");
  row("page_real_time_factor", at(0.5, rates), "x");
  // Interactions that take less than 16 ms are not told of, and count as that.
  row("page_interaction_p95", at(0.95, await page.evaluate(() => [...globalThis.interactions.values(), 16])), "ms");
  await page.close();
}

// From a mesh that is brought to a verdict, as fast as the page goes.
async function upload(served) {
  const { page } = await visit(served);
  await untilReady(page);
  await page.selectOption("#speed", "4");
  const file = { name: "bottle.obj", mimeType: "text/plain", buffer: Buffer.from(bottle(TRIANGLES)) };
  const began = performance.now();
  await page.setInputFiles("#file", file);
  await page.waitForFunction(() => document.getElementById("report-mesh").textContent.includes("20,000"));
  await untilReady(page);
  row("page_upload", performance.now() - began, "ms");
  await page.click("#grasp");
  await page.waitForSelector("[data-phase=verdict].is-now");
  row("page_upload_to_verdict", performance.now() - began, "ms");
  await page.close();
}

const served = await open();
try {
  await visits(served);
  await liveliness(served);
  await upload(served);
} finally {
  await served.close();
}
