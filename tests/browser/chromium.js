// The served release build in headless Chromium, for the tests beside this file.

import { spawn } from "node:child_process";
import { mkdirSync } from "node:fs";
import { createInterface } from "node:readline";
import { fileURLToPath } from "node:url";
import { chromium } from "playwright-core";

const root = fileURLToPath(new URL("../..", import.meta.url));
export const program = process.env.NGF ?? `${root}target/debug/ngf`;
const browserProgram = process.env.CHROMIUM ?? "/usr/bin/chromium";
const screenshots = process.env.SCREENSHOTS ?? `${root}target/screenshots`;

// Software graphics draw a few frames a second; what waits for a picture may take its time.
export const PATIENCE = 120_000;

export const WIDE = { width: 1440, height: 900 };
export const PHONE = { width: 390, height: 844 };

// Begins a server on a free port and a browser; `close` ends both.
export async function open() {
  const args = ["serve", "--port", "0", "--web", `${root}web/dist`, "--models", `${root}models`];
  const server = spawn(program, args, { stdio: ["ignore", "pipe", "inherit"] });
  const [address] = await new Promise((resolve, reject) => {
    server.once("error", reject);
    server.once("exit", () => reject(new Error(`${program} stopped before it served`)));
    createInterface(server.stdout).once("line", (line) => resolve([line]));
  });
  server.removeAllListeners("exit");
  const launched = chromium.launch({
    executablePath: browserProgram,
    args: [
      "--no-sandbox",
      "--disable-gpu",
      "--disable-background-networking",
      "--disable-component-update",
      "--disable-sync",
      "--no-first-run",
    ],
  });
  // A server that nobody ends keeps the tests from ending.
  const browser = await launched.catch((error) => {
    server.kill();
    throw error;
  });
  const close = async () => {
    await browser.close();
    server.kill();
  };
  return { address, browser, close };
}

// A page with its first picture, and a list of all that went wrong on it so far.
export async function visit({ address, browser }, { viewport = WIDE, colorScheme = "light", isCalm = true } = {}) {
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
  page.on("requestfailed", (request) => complaints.push(`${request.url()} failed`));
  page.on("request", (request) => {
    const isOurs = request.url().startsWith(address) || request.url().startsWith("blob:");
    if (!isOurs) complaints.push(`${request.url()} is another host's`);
  });
  await page.goto(address);
  await page.waitForFunction(() => Number(document.getElementById("view").dataset.drawn) > 0);
  return { page, complaints };
}

export async function screenshot(page, name) {
  mkdirSync(screenshots, { recursive: true });
  await page.screenshot({ path: `${screenshots}/${name}.png` });
}

// Waits until an attempt can begin.
export async function untilReady(page) {
  await page.waitForSelector("#grasp:enabled");
}
