// The served release build in headless Chromium, for the tests beside this file.

import { spawn } from "node:child_process";
import { mkdirSync, readFileSync } from "node:fs";
import { createInterface } from "node:readline";
import { fileURLToPath } from "node:url";
import { chromium } from "playwright-core";

export const root = fileURLToPath(new URL("../..", import.meta.url));
export const program = process.env.NGF ?? `${root}target/debug/ngf`;
const browserProgram = process.env.CHROMIUM ?? "/usr/bin/chromium";
const axe = readFileSync(new URL("node_modules/axe-core/axe.min.js", import.meta.url), "utf8");
const screenshots = process.env.SCREENSHOTS ?? `${root}target/screenshots`;

// Software graphics draw a few frames a second; what waits for a picture may take its time.
export const PATIENCE = 120_000;

export const WIDE = { width: 1440, height: 900 };
export const PHONE = { width: 390, height: 844 };

// Begins a server on a port, 0 being a free one; with a folder for data it does jobs, with a file of a token for those
// who have it.
export async function serve({ port = 0, data = null, tokenFile = null } = {}) {
  const args = ["serve", "--port", String(port), "--web", `${root}web/dist`, "--models", `${root}models`];
  // A test may ask as fast as it can.
  if (data) args.push("--data", data, "--rate", "10000");
  if (tokenFile) args.push("--token-file", tokenFile);
  const server = spawn(program, args, { env: { ...process.env, NGF_LOG: "warn" }, stdio: ["ignore", "pipe", "inherit"] });
  const address = await new Promise((resolve, reject) => {
    server.once("error", reject);
    server.once("exit", () => reject(new Error(`${program} stopped before it served`)));
    createInterface(server.stdout).once("line", resolve);
  });
  server.removeAllListeners("exit");
  return { address, server };
}

// Begins a browser, with further arguments if need be.
export function launch(more = []) {
  return chromium.launch({
    executablePath: browserProgram,
    args: [
      "--no-sandbox",
      "--disable-gpu",
      "--disable-background-networking",
      "--disable-component-update",
      "--disable-sync",
      "--no-first-run",
      ...more,
    ],
  });
}

// Begins a server and a browser; `close` ends both.
export async function open({ data = null, args = [] } = {}) {
  const { address, server } = await serve({ data });
  // A server that nobody ends keeps the tests from ending.
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

// An empty page that tells all that goes wrong on it.
export async function blank({ address, browser }, { viewport = WIDE, colorScheme = "light", isCalm = true } = {}) {
  const page = await browser.newPage({
    viewport,
    colorScheme,
    reducedMotion: isCalm ? "reduce" : "no-preference",
  });
  page.setDefaultTimeout(PATIENCE);
  const complaints = [];
  page.on("console", (message) => {
    if (message.type() === "error") complaints.push(message.text());
  });
  page.on("pageerror", (error) => complaints.push(error.message));
  page.on("requestfailed", (request) => complaints.push(`${request.url()} failed: ${request.failure()?.errorText}`));
  page.on("request", (request) => {
    const isOurs = request.url().startsWith(address) || request.url().startsWith("blob:");
    if (!isOurs) complaints.push(`${request.url()} is another host's`);
  });
  return { page, complaints };
}

// What axe finds to be serious for those who do not see, hear or move as most do.
export async function barriers(page) {
  await page.evaluate(axe);
  const { violations } = await page.evaluate(() => globalThis.axe.run());
  return violations
    .filter(({ impact }) => ["serious", "critical"].includes(impact))
    .map(({ id, nodes }) => `${id}: ${nodes.map(({ html }) => html.slice(0, 120)).join(" | ")}`);
}

// The demo with its first picture, and a list of all that went wrong on it so far.
export async function visit(served, options = {}) {
  const { page, complaints } = await blank(served, options);
  await page.goto(served.address + (options.path ?? ""));
  await page.waitForFunction(() => Number(document.getElementById("view").dataset.drawn) > 0);
  return { page, complaints };
}

export async function screenshot(page, name) {
  mkdirSync(screenshots, { recursive: true });
  // What has come to rest is drawn once more, finely.
  await page.waitForTimeout(600);
  await page.screenshot({ path: `${screenshots}/${name}.png` });
}

// Waits until an attempt can begin.
export async function untilReady(page) {
  await page.waitForSelector("#grasp:enabled");
}

// The simulation stops and is restarted.
export async function restart(page) {
  await page.workers()[0].evaluate(() => {
    setTimeout(() => {
      throw new Error("stopped by a test");
    });
  });
  await page.click('[data-code="engine_stopped"] .again');
  await page.waitForSelector('[data-code="engine_stopped"]', { state: "detached" });
  await untilReady(page);
}

// The attempt of a seed, as fast as it goes: what it came to, the hash of its final state, and the count.
export async function grasp(page, seed) {
  await page.fill("#seed", String(seed));
  await page.press("#seed", "Enter");
  await page.selectOption("#speed", "4");
  // What an earlier attempt came to is no answer.
  await page.evaluate(() => (document.getElementById("hash").title = ""));
  await page.click("#grasp");
  await page.waitForFunction(() => document.getElementById("hash").title !== "");
  const said = await page.textContent("#hash");
  if (!said.startsWith(`Seed ${seed} ended`)) throw new Error(`the pose is not the seed's: ${said}`);
  return {
    words: await page.textContent("#headline"),
    hash: await page.getAttribute("#hash", "title"),
    tally: await page.textContent("#tally"),
  };
}

// Runs in the page: a point where the pointer could grab the object.
export function findObject() {
  const canvas = document.getElementById("view");
  const { width, height } = canvas.getBoundingClientRect();
  for (let y = 0.2 * height; y < 0.75 * height; y += 8) {
    for (let x = 0.2 * width; x < 0.8 * width; x += 8) {
      canvas.dispatchEvent(new PointerEvent("pointermove", { clientX: x, clientY: y, pointerType: "mouse" }));
      if (canvas.style.cursor === "grab") return [x, y + 16];
    }
  }
  throw new Error("the object cannot be grabbed anywhere");
}
