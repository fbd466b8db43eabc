// Records the animated WebP of the README: `npm run record-video -- FILE`.

import { writeFileSync } from "node:fs";
import { argv } from "node:process";
import { newPage, open, untilReady, visit } from "./chromium.js";

// Objects to lift, with the seed of each attempt.
const SCENES = [["sugar_box", 0], ["mustard", 3]];
const VIEWPORT = { width: 1120, height: 700 };
const WIDTH = 800;
// Control ticks (30/s) between frames.
const STRIDE = 3;
// Duration of a frame (ms).
const FRAME_MS = 100;
// Additional duration of the last frame of a scene (ms).
const LAST_FRAME_MS = 1_200;
const QUALITY = 0.8;
// Interval between full frames, which remove compression artifacts.
const KEYFRAME_INTERVAL = 30;
// Delay until a resting scene is rendered at full resolution (ms).
const REST_MS = 500;

// Runs in the page: compares a PNG with the previous one; returns the changed rectangle as WebP.
async function encodeChange({ png, isKeyframe, width, height, quality }) {
  const image = await createImageBitmap(await (await fetch(`data:image/png;base64,${png}`)).blob(), { resizeWidth: width, resizeHeight: height, resizeQuality: "high" });
  const canvas = new OffscreenCanvas(width, height);
  const context = canvas.getContext("2d");
  context.drawImage(image, 0, 0);
  const now = new Uint32Array(context.getImageData(0, 0, width, height).data.buffer);
  const before = globalThis.before ?? new Uint32Array(now.length);
  globalThis.before = now;
  const changed = isKeyframe ? [0, 0, width, height] : [width, height, 0, 0];
  now.forEach((pixel, i) => {
    if (pixel === before[i]) return;
    const [x, y] = [i % width, Math.floor(i / width)];
    changed[0] = Math.min(changed[0], x);
    changed[1] = Math.min(changed[1], y);
    changed[2] = Math.max(changed[2], x + 1);
    changed[3] = Math.max(changed[3], y + 1);
  });
  if (changed[0] > changed[2]) return null;
  // Offsets in an animated WebP are even.
  const [x, y] = [changed[0] & ~1, changed[1] & ~1];
  const part = new OffscreenCanvas(changed[2] - x, changed[3] - y);
  part.getContext("2d").drawImage(canvas, -x, -y);
  const blob = await part.convertToBlob({ type: "image/webp", quality });
  const bytes = new Uint8Array(await blob.arrayBuffer());
  return { x, y, width: part.width, height: part.height, webp: btoa(bytes.reduce((text, byte) => text + String.fromCharCode(byte), "")) };
}

function number(value, bytes) {
  const buffer = Buffer.alloc(bytes);
  buffer.writeUIntLE(value, 0, bytes);
  return buffer;
}

// RIFF chunk: name, length, content, padded to even length.
function chunk(name, ...content) {
  const body = Buffer.concat(content);
  return Buffer.concat([Buffer.from(name), number(body.length, 4), body, Buffer.alloc(body.length % 2)]);
}

// The VP8 chunk of a single-image WebP file.
function imageChunk(file) {
  // RIFF, length, WEBP.
  for (let at = 12; at < file.length; ) {
    const size = file.readUInt32LE(at + 4);
    const end = at + 8 + size + (size % 2);
    if (file.toString("latin1", at, at + 4) === "VP8 ") return file.subarray(at, end);
    at = end;
  }
  throw new Error("the WebP file has no VP8 chunk");
}

// Animated WebP of the frames (WebP container specification: VP8X, ANIM, ANMF).
function animation(frames, width, height) {
  const parts = frames.map(({ x, y, width, height, webp, milliseconds }) => {
    const image = imageChunk(Buffer.from(webp, "base64"));
    const header = [x / 2, y / 2, width - 1, height - 1, milliseconds].map((value) => number(value, 3));
    // Flags: replace the rectangle, keep the rest of the canvas.
    return chunk("ANMF", ...header, number(2, 1), image);
  });
  const header = chunk("VP8X", number(2, 1), number(0, 3), number(width - 1, 3), number(height - 1, 3));
  return chunk("RIFF", Buffer.from("WEBP"), header, chunk("ANIM", number(0xffffffff, 4), number(0, 2)), ...parts);
}

// Runs the attempt of a seed to its outcome; returns its last tick.
async function attempt(page, object, seed) {
  await page.check(`#objects [value=${object}]`, { force: true });
  await page.fill("#seed", String(seed));
  await page.press("#seed", "Enter");
  await page.selectOption("#speed", "4");
  await page.click("#grasp");
  await page.waitForSelector("[data-phase=outcome].is-now");
  await page.waitForFunction(() => document.getElementById("hash").title !== "");
  return Number(await page.getAttribute("#timeline", "max"));
}

async function showTick(page, tick) {
  await page.$eval("#timeline", (slider, value) => {
    slider.value = value;
    slider.dispatchEvent(new Event("input", { bubbles: true }));
  }, String(tick));
  await page.waitForTimeout(REST_MS);
}

const served = await open();
try {
  const { page } = await visit(served, { viewport: VIEWPORT, pixelRatio: 1 });
  await untilReady(page);
  const { page: encoder } = await newPage(served);
  const height = Math.round((WIDTH * VIEWPORT.height) / VIEWPORT.width);
  const frames = [];
  for (const [object, seed] of SCENES) {
    const last = await attempt(page, object, seed);
    for (let tick = 0; tick < last + STRIDE; tick += STRIDE) {
      await showTick(page, Math.min(tick, last));
      const png = (await page.screenshot()).toString("base64");
      const frame = await encoder.evaluate(encodeChange, { png, isKeyframe: frames.length % KEYFRAME_INTERVAL === 0, width: WIDTH, height, quality: QUALITY });
      if (frame) frames.push({ ...frame, milliseconds: FRAME_MS });
      else frames.at(-1).milliseconds += FRAME_MS;
    }
    frames.at(-1).milliseconds += LAST_FRAME_MS;
  }
  const bytes = animation(frames, WIDTH, height);
  writeFileSync(argv[2], bytes);
  const seconds = frames.reduce((sum, { milliseconds }) => sum + milliseconds, 0) / 1_000;
  console.log(`${argv[2]}: ${frames.length} frames, ${seconds.toFixed(1)} s, ${(bytes.length / 1e6).toFixed(2)} MB`);
} finally {
  await served.close();
}
