// Attempts and videos in Firefox and WebKitGTK; the test suite uses Chromium. The final states of the attempts equal
// those of `ngf evaluate`.

import assert from "node:assert/strict";
import { execFileSync, spawn } from "node:child_process";
import { mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { createServer } from "node:net";
import { after, before, test } from "node:test";
import { Browser, Builder, By, until } from "selenium-webdriver";
import { program, root, screenshots, serve } from "./chromium.js";

const ATTEMPTS = 20;
const OBJECT = "sugar_box";
// Timeout of a batch (ms); software rendering slows it down.
const BATCH_MS = 600_000;

// Each driver is a program with the WebDriver protocol.
const ENGINES = [
  {
    name: "Firefox",
    driver: (port) => [process.env.GECKODRIVER ?? "geckodriver", "--port", String(port)],
    capabilities: {
      browserName: Browser.FIREFOX,
      "moz:firefoxOptions": { binary: process.env.FIREFOX ?? "/usr/bin/firefox-esr", args: ["-headless", "--width=1440", "--height=900"] },
    },
  },
  {
    name: "WebKitGTK",
    driver: (port) => [process.env.WEBKIT_DRIVER ?? "WebKitWebDriver", `--port=${port}`],
    capabilities: { browserName: "MiniBrowser" },
  },
];

let served;
// Seed, lift and hash of the final state of each native attempt.
let native;

before(async () => {
  const report = `${root}target/tmp/engines.json`;
  mkdirSync(`${root}target/tmp`, { recursive: true });
  execFileSync(program, ["evaluate", "--model", "default", "--object", OBJECT, "--attempts", String(ATTEMPTS), "--json", report], { cwd: root });
  const [{ rows }] = JSON.parse(readFileSync(report, "utf8"));
  native = rows.map(({ seed, outcome, final_state_hash }) => [seed, outcome.result === "lifted", final_state_hash]);
  served = await serve();
});
after(() => served?.server.kill());

for (const engine of ENGINES) {
  test(`${engine.name}: attempts equal native ones, and a video of an attempt plays`, async () => {
    const port = await freePort();
    const [file, ...args] = engine.driver(port);
    const driver = spawn(file, args, { stdio: ["ignore", "ignore", "inherit"] });
    try {
      const url = `http://127.0.0.1:${port}`;
      await untilListening(url);
      const browser = await new Builder().usingServer(url).withCapabilities(engine.capabilities).build();
      try {
        await checkEngine(browser, engine.name);
      } finally {
        await browser.quit();
      }
    } finally {
      driver.kill();
    }
  });
}

async function checkEngine(browser, name) {
  const untilText = (id, pattern, ms) => browser.wait(until.elementTextMatches(browser.findElement(By.id(id)), pattern), ms);
  await browser.get(served.address);
  await browser.wait(until.elementIsEnabled(browser.findElement(By.id("grasp"))), 60_000);
  // Downloads are kept in the page.
  await browser.executeScript(() => {
    const create = URL.createObjectURL;
    URL.createObjectURL = (blob) => ((globalThis.downloaded = blob), create(blob));
  });

  await browser.executeScript(() => document.getElementById("batch-run").click());
  await untilText("batch-summary", new RegExp(`of ${ATTEMPTS}$|of ${ATTEMPTS} `), BATCH_MS);
  await untilText("batch-run", /^Run$/, BATCH_MS);
  await browser.executeScript(() => document.getElementById("batch-csv").click());
  const csv = await browser.executeAsyncScript((done) => globalThis.downloaded.text().then(done));
  const rows = csv.trim().split("\n").slice(1).map((row) => row.split(","));
  assert.deepEqual(rows.map((row) => [Number(row[1]), row[5] === "true", row.at(-1)]), native);

  // After an outcome nothing moves, so the attempt is played again.
  await browser.executeScript(() => document.getElementById("grasp").click());
  await browser.wait(until.elementLocated(By.css("[data-phase=outcome].is-now")), 120_000);
  await browser.executeScript(() => document.getElementById("save-webm").click());
  await browser.wait(until.elementLocated(By.css("[data-phase=approach].is-now")), 60_000);
  await browser.sleep(4_000);
  await browser.executeScript(() => {
    globalThis.downloaded = null;
    document.getElementById("save-webm").click();
  });
  await browser.wait(() => browser.executeScript(() => globalThis.downloaded !== null), 20_000);
  mkdirSync(screenshots, { recursive: true });
  writeFileSync(`${screenshots}/engine-${name}.png`, await browser.takeScreenshot(), "base64");
  // The policy of the page does not allow to play it there.
  const film = await browser.executeAsyncScript((done) => {
    const reader = new FileReader();
    reader.onload = () => done(reader.result);
    reader.readAsDataURL(globalThis.downloaded);
  });
  await browser.get("about:blank");
  const seconds = await browser.executeAsyncScript((film, done) => {
    const video = Object.assign(document.createElement("video"), { muted: true, src: film });
    video.onerror = () => done(video.error.message);
    let seconds = 0;
    video.ontimeupdate = () => (seconds = Math.max(seconds, video.currentTime));
    video.onended = () => done(seconds);
    document.body.append(video);
    video.play().catch((error) => done(String(error)));
  }, film);
  assert.ok(seconds > 1, `the video played for ${seconds} s`);
}

function freePort() {
  return new Promise((resolve, reject) => {
    const server = createServer();
    server.once("error", reject);
    server.listen(0, "127.0.0.1", () => {
      const { port } = server.address();
      server.close(() => resolve(port));
    });
  });
}

async function untilListening(url) {
  for (let k = 0; k < 100; k += 1) {
    if (await fetch(`${url}/status`).then(({ ok }) => ok, () => false)) return;
    await new Promise((resolve) => setTimeout(resolve, 100));
  }
  throw new Error(`no driver at ${url}`);
}
