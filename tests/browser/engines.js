// Attempts and videos in Firefox and WebKitGTK; the test suite uses Chromium. The final states of the attempts equal
// those of `ngf evaluate`.

import assert from "node:assert/strict";
import { execFileSync, spawn } from "node:child_process";
import { mkdirSync, mkdtempSync, readFileSync, readdirSync, rmSync, statSync, writeFileSync } from "node:fs";
import { createServer } from "node:net";
import { tmpdir } from "node:os";
import { after, before, test } from "node:test";
import { Browser, Builder, By, until } from "selenium-webdriver";
import { program, root, screenshots, serve } from "./chromium.js";

// The page's default number of attempts per batch.
const ATTEMPTS = 20;
const OBJECT = "sugar_box";
// Timeout of a batch (ms); software rendering slows it down.
const BATCH_MS = 600_000;
// Timeout of a phase of an attempt (ms).
const PHASE_MS = 120_000;

// Downloads of Firefox.
const downloads = mkdtempSync(`${tmpdir()}/ngf-engines-`);

// Each driver is a program with the WebDriver protocol. `save` clicks the button of this id and returns the bytes of the
// downloaded file.
const ENGINES = [
  {
    name: "Firefox",
    recordsVideo: true,
    driver: (port) => [process.env.GECKODRIVER ?? "geckodriver", "--port", String(port)],
    capabilities: {
      browserName: Browser.FIREFOX,
      "moz:firefoxOptions": {
        binary: process.env.FIREFOX ?? "/usr/bin/firefox-esr",
        args: ["-headless", "--width=1440", "--height=900"],
        prefs: { "browser.download.folderList": 2, "browser.download.dir": downloads },
      },
    },
    async save(browser, id) {
      await click(browser, id);
      const finished = () => readdirSync(downloads).filter((name) => !name.endsWith(".part") && statSync(`${downloads}/${name}`).size > 0);
      const [name] = await browser.wait(async () => finished().length > 0 && finished(), 20_000);
      const bytes = readFileSync(`${downloads}/${name}`);
      rmSync(`${downloads}/${name}`);
      return bytes;
    },
  },
  {
    name: "WebKitGTK",
    recordsVideo: false,
    driver: (port) => [process.env.WEBKIT_DRIVER ?? "WebKitWebDriver", `--port=${port}`],
    capabilities: { browserName: "MiniBrowser" },
    // MiniBrowser asks where to save a file, so the page keeps it.
    async save(browser, id) {
      await browser.executeScript(() => {
        const create = URL.createObjectURL;
        globalThis.saved = null;
        URL.createObjectURL = (blob) => ((globalThis.saved = blob), create.call(URL, blob));
      });
      await click(browser, id);
      await browser.wait(() => browser.executeScript(() => globalThis.saved !== null), 20_000);
      const url = await browser.executeAsyncScript((done) => {
        const reader = new FileReader();
        reader.onload = () => done(reader.result);
        reader.readAsDataURL(globalThis.saved);
      });
      return Buffer.from(url.slice(url.indexOf(",") + 1), "base64");
    },
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
after(() => {
  served?.server.kill();
  rmSync(downloads, { recursive: true });
});

for (const engine of ENGINES) {
  test(`${engine.name}: attempts equal native ones, and a video of an attempt plays`, async (context) => {
    const port = await freePort();
    const [file, ...args] = engine.driver(port);
    const driver = spawn(file, args, { stdio: ["ignore", "ignore", "inherit"] });
    try {
      const url = `http://127.0.0.1:${port}`;
      await untilListening(url);
      const browser = await new Builder().usingServer(url).withCapabilities(engine.capabilities).build();
      try {
        await checkEngine(browser, engine, context);
      } finally {
        await browser.quit();
      }
    } finally {
      driver.kill();
    }
  });
}

async function checkEngine(browser, { name, recordsVideo, save }, context) {
  // Selects have the style of the page, not that of the engine.
  const isStyled = () => [...document.querySelectorAll("select")].every((select) => getComputedStyle(select).appearance === "none");
  const untilText = (id, pattern, ms) => browser.wait(until.elementTextMatches(browser.findElement(By.id(id)), pattern), ms);
  const untilPhase = (phase) => browser.wait(until.elementLocated(By.css(`[data-phase=${phase}].is-now`)), PHASE_MS);
  await browser.get(served.address);
  await browser.wait(until.elementIsEnabled(browser.findElement(By.id("grasp"))), 60_000);
  assert.ok(await browser.executeScript(isStyled), "a select has the style of the engine");
  await click(browser, "batch-run");
  await untilText("batch-summary", new RegExp(`of ${ATTEMPTS} `), BATCH_MS);
  await untilText("batch-run", /^Run$/, BATCH_MS);
  const csv = (await save(browser, "batch-csv")).toString();
  const rows = csv.trim().split("\n").slice(1).map((row) => row.split(","));
  assert.deepEqual(rows.map((row) => [Number(row[1]), row[5] === "true", row.at(-1)]), native);

  // After an outcome nothing moves, so the attempt is played again.
  await click(browser, "grasp");
  await untilPhase("outcome");
  await click(browser, "save-webm");
  await untilPhase("approach");
  await browser.sleep(4_000);
  mkdirSync(screenshots, { recursive: true });
  writeFileSync(`${screenshots}/engine-${name}.png`, await browser.takeScreenshot(), "base64");
  if (!recordsVideo) {
    // GStreamer before 1.24 does not record what WebKitGTK draws; the page says so.
    await click(browser, "save-webm");
    await untilText("share-hint", /^No video was recorded: /, 20_000);
    return context.diagnostic("no video");
  }
  const film = `data:video/webm;base64,${(await save(browser, "save-webm")).toString("base64")}`;
  // The content security policy of the page does not allow to play it there.
  await browser.get("about:blank");
  const seconds = await browser.executeAsyncScript((film, done) => {
    const video = Object.assign(document.createElement("video"), { muted: true, src: film });
    let seconds = 0;
    video.onerror = () => done(video.error.message);
    video.ontimeupdate = () => (seconds = Math.max(seconds, video.currentTime));
    video.onended = () => done(seconds);
    document.body.append(video);
    video.play().catch((error) => done(String(error)));
  }, film);
  assert.ok(seconds > 1, `the video played for ${seconds} s`);
}

function click(browser, id) {
  return browser.executeScript((id) => document.getElementById(id).click(), id);
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
