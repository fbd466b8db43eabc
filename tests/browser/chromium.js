// Test fixture: `ngf serve` with the built page, and headless Chromium.

import { spawn } from "node:child_process";
import { mkdirSync, readFileSync } from "node:fs";
import { createInterface } from "node:readline";
import { fileURLToPath } from "node:url";
import { chromium } from "playwright-core";

export const root = fileURLToPath(new URL("../..", import.meta.url));
export const program = process.env.NGF ?? `${root}target/debug/ngf`;
const browserProgram = process.env.CHROMIUM ?? "/usr/bin/chromium";
const axe = readFileSync(new URL("node_modules/axe-core/axe.min.js", import.meta.url), "utf8");
export const screenshots = process.env.SCREENSHOTS ?? `${root}target/screenshots`;

// Timeout (ms); software rendering draws only a few frames per second.
export const TIMEOUT_MS = 120_000;

export const WIDE = { width: 1440, height: 900 };
export const PHONE = { width: 390, height: 844 };

// Device pixels per CSS pixel. Software rendering takes most of the time of the tests, and layout does not depend on it.
// PIXEL_RATIO=1 gives screenshots of full size.
const PIXEL_RATIO = Number(process.env.PIXEL_RATIO ?? 0.5);

// Starts a server. Port 0 selects a free one; `data` enables jobs; `tokenFile` requires its token for write requests.
export async function serve({ port = 0, data = null, tokenFile = null } = {}) {
  const args = ["serve", "--port", String(port), "--web-dir", `${root}web/dist`, "--models-dir", `${root}models`];
  // Tests need no rate limit.
  if (data) args.push("--data-dir", data, "--max-writes-per-second", "10000");
  if (tokenFile) args.push("--token-file", tokenFile);
  const server = spawn(program, args, { env: { ...process.env, NGF_LOG: "warn" }, stdio: ["ignore", "pipe", "inherit"] });
  const address = await new Promise((resolve, reject) => {
    server.once("error", reject);
    server.once("exit", () => reject(new Error(`${program} exited before it printed its address`)));
    createInterface(server.stdout).once("line", resolve);
  });
  server.removeAllListeners("exit");
  return { address, server };
}

// Launches a browser with additional arguments.
export function launch(extraArgs = []) {
  return chromium.launch({
    executablePath: browserProgram,
    args: [
      "--no-sandbox",
      "--disable-gpu",
      "--disable-background-networking",
      "--disable-component-update",
      "--disable-sync",
      "--no-first-run",
      ...extraArgs,
    ],
  });
}

// Starts a server and a browser; `close` stops both.
export async function open({ data = null, args = [] } = {}) {
  const { address, server } = await serve({ data });
  // A running server would keep the test process alive.
  const browser = await launch(args).catch((error) => {
    server.kill();
    throw error;
  });
  const close = async () => {
    await browser.close();
    server.kill();
  };
  return { address, browser, server, close };
}

// Creates an empty page and collects its errors, failed requests, and requests to other hosts.
export async function newPage({ address, browser }, { viewport = WIDE, colorScheme = "light", reducesMotion = true, pixelRatio = PIXEL_RATIO } = {}) {
  const page = await browser.newPage({
    viewport,
    deviceScaleFactor: pixelRatio,
    colorScheme,
    reducedMotion: reducesMotion ? "reduce" : "no-preference",
  });
  // Also for pages that this page opens.
  page.context().setDefaultTimeout(TIMEOUT_MS);
  const errors = [];
  page.on("console", (message) => {
    if (message.type() === "error") errors.push(message.text());
  });
  page.on("pageerror", (error) => errors.push(error.message));
  page.on("requestfailed", (request) => errors.push(`${request.url()} failed: ${request.failure()?.errorText}`));
  page.on("request", (request) => {
    const isLocal = request.url().startsWith(address) || request.url().startsWith("blob:");
    if (!isLocal) errors.push(`${request.url()} is on another host`);
  });
  return { page, errors };
}

// Serious and critical accessibility violations (axe-core).
export async function a11yViolations(page) {
  await page.evaluate(axe);
  const { violations } = await page.evaluate(() => globalThis.axe.run());
  return violations
    .filter(({ impact }) => ["serious", "critical"].includes(impact))
    .map(({ id, nodes }) => `${id}: ${nodes.map(({ html }) => html.slice(0, 120)).join(" | ")}`);
}

// Opens the demo and waits for the first frame.
export async function visit(served, options = {}) {
  const { page, errors } = await newPage(served, options);
  await page.goto(served.address + (options.path ?? ""));
  await page.waitForFunction(() => Number(document.getElementById("view").dataset.drawn) > 0);
  return { page, errors };
}

export async function screenshot(page, name) {
  mkdirSync(screenshots, { recursive: true });
  // A resting scene is rendered once more at full resolution.
  await page.waitForTimeout(600);
  await page.screenshot({ path: `${screenshots}/${name}.png` });
}

// Waits until an attempt can be started.
export async function untilReady(page) {
  await page.waitForSelector("#grasp:enabled");
}

// Stops the worker and restarts it from the error card.
export async function restart(page) {
  await page.workers()[0].evaluate(() => {
    setTimeout(() => {
      throw new Error("stopped by a test");
    });
  });
  await page.click('[data-code="worker_stopped"] .retry');
  await page.waitForSelector('[data-code="worker_stopped"]', { state: "detached" });
  await untilReady(page);
}

// Runs the attempt of a seed at maximum speed; returns outcome text, final state hash and tally.
export async function grasp(page, seed) {
  await page.fill("#seed", String(seed));
  await page.press("#seed", "Enter");
  await page.selectOption("#speed", "4");
  // Clears the result of an earlier attempt.
  await page.evaluate(() => (document.getElementById("hash").title = ""));
  await page.click("#grasp");
  await page.waitForFunction(() => document.getElementById("hash").title !== "");
  const text = await page.textContent("#hash");
  if (!text.startsWith(`Seed ${seed}. Final state:`)) throw new Error(`unexpected attempt: ${text}`);
  return {
    headline: await page.textContent("#headline"),
    hash: await page.getAttribute("#hash", "title"),
    tally: await page.textContent("#tally"),
  };
}

// Runs in the page: a point where the pointer can grab the object.
export function findObject() {
  const canvas = document.getElementById("view");
  const { width, height } = canvas.getBoundingClientRect();
  for (let y = 0.2 * height; y < 0.75 * height; y += 8) {
    for (let x = 0.2 * width; x < 0.8 * width; x += 8) {
      canvas.dispatchEvent(new PointerEvent("pointermove", { clientX: x, clientY: y, pointerType: "mouse" }));
      if (canvas.style.cursor === "grab") return [x, y + 16];
    }
  }
  throw new Error("the object cannot be grabbed");
}
