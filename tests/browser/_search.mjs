import { open, untilReady, visit, screenshot } from "./chromium.js";
const served = await open();
const { page, errors } = await visit(served, { pixelRatio: 1 });
page.on("console", (m) => console.log("console", m.text()));
await untilReady(page);
const [mesh, mass] = [process.argv[2], process.argv[3]];
if (mesh) {
  await page.setInputFiles("#file", mesh);
  await page.waitForSelector(`#objects [value='file:${mesh.split("/").at(-1)}']:checked`, { timeout: 60000 });
  if (mass) { await page.evaluate(() => document.querySelectorAll("details").forEach((d) => (d.open = true))); await page.fill("#mass", mass); await page.press("#mass", "Enter"); await page.waitForTimeout(3000); }
}
const t = performance.now();
let first = null;
await page.evaluate(() => document.querySelectorAll("details").forEach((d) => (d.open = true)));
await page.click("#search");
for (;;) {
  await page.waitForTimeout(200);
  const s = await page.textContent("#search-status");
  const m = /, (\d+) robust/.exec(s);
  if (m && Number(m[1]) > 0 && !first) { first = performance.now() - t; console.log("first", (first / 1000).toFixed(1)); await screenshot(page, "search-running"); }
  if (/selected|none robust|Stopped|policy/.test(s) || errors.length) { console.log(s); break; }
  if (performance.now() - t > 120000) { console.log("timeout", s); break; }
}
console.log("all", ((performance.now() - t) / 1000).toFixed(1), errors);
await page.selectOption("#speed", "4");
await page.waitForSelector("[data-phase=outcome].is-now");
console.log(await page.textContent("#headline"));
await page.locator("#search-grasps").scrollIntoViewIfNeeded();
await screenshot(page, "search-done");
await served.close();
