// The demo page: rendering, content security policy, layout, keyboard, accessibility, touch.

import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { a11yViolations, newPage, findObject, open, PHONE, screenshot, untilReady, visit, WIDE } from "./chromium.js";

let served;
before(async () => (served = await open()));
after(() => served?.close());

for (const [shape, viewport] of Object.entries({ wide: WIDE, phone: PHONE })) {
  for (const colorScheme of ["light", "dark"]) {
    test(`demo renders without errors, ${shape} and ${colorScheme}`, async () => {
      const { page, errors } = await visit(served, { viewport, colorScheme });
      await untilReady(page);
      const ground = await page.evaluate(() => getComputedStyle(document.body).backgroundColor);
      const brightness = Math.max(...ground.match(/\d+/g).map(Number));
      assert.equal(brightness < 128, colorScheme === "dark", ground);
      await screenshot(page, `${shape}-${colorScheme}`);
      assert.deepEqual(errors, []);
      await page.close();
    });
  }
}

// Runs in the page: visible controls that are clipped, outside of their container, or overlap.
const layoutErrors = () => {
  const nameOf = (control) => control.id || control.value || control.textContent;
  const isIn = (inner, outer) =>
    inner.left >= outer.left - 1 && inner.right <= outer.right + 1 && inner.top >= outer.top - 1;
  const controls = [...document.querySelectorAll(".dock button, .dock select, .cameras button, h1")].filter(
    (control) => control.checkVisibility({ visibilityProperty: true }),
  );
  const boxes = controls.map((control) => control.getBoundingClientRect());
  const screen = { left: 0, right: innerWidth, top: 0 };
  const found = [];
  // In narrow windows the dock spans the width.
  const dock = document.querySelector(".dock").getBoundingClientRect();
  if (innerWidth < 800 && dock.width < innerWidth - 1) found.push(`the dock is ${dock.width} pixels wide`);
  controls.forEach((control, i) => {
    const container = control.closest(".dock")?.getBoundingClientRect() ?? screen;
    if (!isIn(boxes[i], screen) || !isIn(boxes[i], container)) found.push(`${nameOf(control)} is clipped`);
    if (boxes[i].bottom > innerHeight + 1) found.push(`${nameOf(control)} is below the window`);
    if (control.scrollWidth > control.clientWidth + 1) found.push(`${nameOf(control)} overflows its button`);
    for (let j = 0; j < i; j++) {
      const isDisjoint =
        boxes[i].left >= boxes[j].right - 1 ||
        boxes[j].left >= boxes[i].right - 1 ||
        boxes[i].top >= boxes[j].bottom - 1 ||
        boxes[j].top >= boxes[i].bottom - 1;
      if (!isDisjoint) found.push(`${nameOf(control)} overlaps ${nameOf(controls[j])}`);
    }
  });
  // Headings keep a margin from the edge of their box. In narrow windows the sheet is the box of the dock.
  const sheetTop = document.querySelector(".sheet").getBoundingClientRect().top;
  for (const heading of document.querySelectorAll(".masthead h1, #headline, .phases button, .panel h2")) {
    if (!heading.checkVisibility({ visibilityProperty: true })) continue;
    const range = document.createRange();
    range.selectNodeContents(heading);
    const [text, box] = [range, heading.closest(".masthead, .dock, .panel")].map((part) => part.getBoundingClientRect());
    const side = Math.min(text.left - box.left, box.right - text.right);
    const top = text.top - (heading.closest(".dock") && sheetTop ? sheetTop : box.top);
    if (side < 8 || top < 4) found.push(`${nameOf(heading)} is ${side} and ${top} pixels from the edge`);
  }
  // The panel scrolls vertically, so only widths are checked.
  for (const section of document.querySelectorAll(".panel > section")) {
    const bounds = section.getBoundingClientRect();
    for (const part of section.querySelectorAll("label, label span, button, input, select, dd, p")) {
      if (!part.checkVisibility({ visibilityProperty: true })) continue;
      if (part.getBoundingClientRect().right > bounds.right + 1) found.push(`${nameOf(part)} exceeds the width of the panel`);
      if (part.matches("span") && part.scrollWidth > part.clientWidth) found.push(`${nameOf(part)} is truncated`);
    }
  }
  // The label of a switch is one line.
  for (const label of document.querySelectorAll(".panel .switch")) {
    const range = document.createRange();
    range.selectNodeContents(label);
    const lines = new Set([...range.getClientRects()].filter(({ height }) => height < 20).map(({ top }) => Math.round(top)));
    if (lines.size > 1) found.push(`${label.textContent} has ${lines.size} lines`);
  }
  // Controls of the browser would differ from the page's.
  for (const select of document.querySelectorAll("select")) {
    if (getComputedStyle(select).appearance !== "none") found.push(`${nameOf(select)} has the browser's style`);
  }
  return found;
};

test("controls fit and do not overlap at any window width", async () => {
  const { page } = await visit(served);
  await untilReady(page);
  for (const width of [320, 390, 640, 700, 768, 800, 900, 960, 1060, 1440]) {
    await page.setViewportSize({ width, height: 800 });
    assert.deepEqual(await page.evaluate(layoutErrors), [], `${width} pixels wide`);
  }
  // A phone on its side, a small window, and a zoom of 200 % in a window of 1440 x 900.
  for (const [width, height] of [[844, 390], [800, 600], [720, 450], [568, 320]]) {
    await page.setViewportSize({ width, height });
    assert.deepEqual(await page.evaluate(layoutErrors), [], `${width} x ${height}`);
    await screenshot(page, `window-${width}x${height}`);
    // The picture between the cameras and the dock.
    const free = await page.evaluate(() => {
      const bottom = document.querySelector(".cameras").getBoundingClientRect().bottom;
      const top = document.querySelector(".sheet").getBoundingClientRect().top || document.querySelector(".dock").getBoundingClientRect().top;
      return (top - bottom) / innerHeight;
    });
    assert.ok(free > 0.4, `${width} x ${height}: ${free} of the height is free`);
  }
  // The camera can bring the robot behind these texts.
  for (const part of [".masthead", ".cameras"]) {
    const color = await page.$eval(part, (element) => getComputedStyle(element).backgroundColor);
    assert.ok(!/transparent|, 0\)|\/ 0\)/.test(color), `${part}: ${color}`);
  }
  await page.setViewportSize({ width: 768, height: 1024 });
  await screenshot(page, "tablet");
  await page.close();
});

test("content security policy blocks eval and third-party scripts", async () => {
  const { page } = await visit(served);
  const [evaluated, blocked] = await page.evaluate(() => {
    const blocked = [];
    addEventListener("securitypolicyviolation", (event) => blocked.push(event.effectiveDirective));
    const script = document.createElement("script");
    script.src = "https://example.invalid/script.js";
    document.head.append(script);
    // Deferred, because code evaluated by the test is exempt.
    setTimeout("globalThis.evaluated = true");
    return new Promise((resolve) => setTimeout(() => resolve([globalThis.evaluated, blocked]), 200));
  });
  assert.equal(evaluated, undefined);
  assert.deepEqual(new Set(blocked), new Set(["script-src", "script-src-elem"]));
  assert.equal(await page.evaluate(() => crossOriginIsolated), true);
  await page.close();
});

test("keyboard shortcuts match the buttons", async () => {
  const { page } = await visit(served);
  await untilReady(page);
  await page.keyboard.press("?");
  assert.ok(await page.isVisible("#help"));
  await page.keyboard.press("Escape");
  await page.waitForSelector("#help", { state: "hidden" });
  const before = await page.inputValue("#pose-x");
  await page.keyboard.press("ArrowUp");
  await page.waitForFunction((x) => document.getElementById("pose-x").value !== x, before);
  // The dialog keeps the focus briefly after closing; keys must work during that time.
  await page.evaluate(() => {
    const key = new KeyboardEvent("keydown", { key: "ArrowDown", bubbles: true });
    document.querySelector("#help button").dispatchEvent(key);
  });
  await page.waitForFunction((x) => document.getElementById("pose-x").value === x, before);
  const yawBefore = await page.inputValue("#pose-yaw");
  await page.keyboard.press("r");
  await page.waitForFunction((yaw) => document.getElementById("pose-yaw").value !== yaw, yawBefore);
  await page.keyboard.press(" ");
  await page.waitForFunction(() => document.getElementById("rate").textContent === "Paused");
  const layers = { c: "cloud", m: "reconstruction", h: "hulls", f: "forces", t: "trail", j: "target", k: "limits", s: "sensor" };
  for (const [key, layer] of Object.entries(layers)) {
    const was = await page.isChecked(`#layer-${layer}`);
    await page.keyboard.press(key);
    assert.equal(await page.isChecked(`#layer-${layer}`), !was, layer);
  }
  await page.keyboard.press("i");
  await page.waitForSelector("#diagnostics[open]");
  for (const [key, preset] of Object.entries({ 1: "front", 2: "side", 3: "top", 4: "sensor" })) {
    await page.keyboard.press(key);
    await page.waitForSelector(`#cameras [value=${preset}][aria-pressed=true]`);
  }
  await page.keyboard.press("0");
  await page.waitForSelector("#cameras [aria-pressed=true]", { state: "detached" });
  const yaw = await page.inputValue("#pose-yaw");
  await page.keyboard.press("q");
  await page.waitForFunction((yaw) => document.getElementById("pose-yaw").value !== yaw, yaw);
  await page.keyboard.press("e");
  await page.waitForFunction((yaw) => document.getElementById("pose-yaw").value === yaw, yaw);
  // Shift and arrow keys orbit the camera without moving the object.
  const pose = () => page.$eval("#pose", (fields) => [...fields.querySelectorAll("input")].map((input) => input.value).join());
  const poseBefore = await pose();
  const images = [];
  for (const key of ["", "Shift+ArrowRight", "Shift+ArrowUp", "+"]) {
    if (key) await page.keyboard.press(key);
    await page.waitForTimeout(700);
    images.push((await page.locator("#view").screenshot()).toString("base64"));
  }
  assert.equal(new Set(images).size, 4, "each key changes the view");
  assert.equal(await pose(), poseBefore);
  // A paused attempt can be stepped forward and back.
  const tick = () => page.$eval("#timeline", ({ value }) => Number(value));
  await page.keyboard.press("g");
  for (let reached = await tick(), k = 0; k < 3; k += 1) {
    await page.keyboard.press(".");
    await page.waitForFunction((reached) => Number(document.getElementById("timeline").value) > reached, reached);
    reached = await tick();
  }
  const reached = await tick();
  await page.keyboard.press(",");
  await page.waitForFunction((reached) => Number(document.getElementById("timeline").value) < reached, reached);
  await page.keyboard.press("Backspace");
  await page.waitForFunction(() => Number(document.getElementById("timeline").value) === 0);
  await page.close();
});

test("disabled keyboard shortcuts stay disabled after a reload", async () => {
  const { page } = await visit(served);
  await untilReady(page);
  await page.click("#help-open");
  await page.click("#keys-on");
  await page.keyboard.press("Escape");
  await page.reload();
  await untilReady(page);
  await page.keyboard.press(" ");
  await page.keyboard.press("?");
  assert.ok(!(await page.isVisible("#help")));
  await page.click("#help-open");
  await page.click("#keys-on");
  await page.keyboard.press("Escape");
  await page.waitForSelector("#help", { state: "hidden" });
  // The earlier key presses had no effect.
  assert.notEqual(await page.textContent("#rate"), "Paused");
  await page.keyboard.press("?");
  assert.ok(await page.isVisible("#help"));
  await page.close();
});

test("camera button is released when the user orbits or zooms", async () => {
  const { page } = await visit(served);
  await untilReady(page);
  const top = "#cameras [value=top]";
  for (const move of [() => page.keyboard.press("Shift+ArrowLeft"), () => page.mouse.wheel(0, 100)]) {
    await page.click(top);
    await page.waitForSelector(`${top}[aria-pressed=true]`);
    await page.hover("#view", { position: { x: 40, y: 300 } });
    await page.evaluate(() => document.activeElement.blur());
    await move();
    await page.waitForSelector(`${top}[aria-pressed=false]`);
  }
  await page.close();
});

test("Space opens a focused section and does not pause", async () => {
  const { page } = await visit(served);
  await untilReady(page);
  await page.focus("#diagnostics summary");
  await page.keyboard.press(" ");
  await page.waitForSelector("#diagnostics[open]");
  // The section is at the lower end of the panel and scrolls into view.
  await page.waitForFunction(() => {
    const [section, panel] = ["diagnostics", "panel"].map((id) => document.getElementById(id).getBoundingClientRect());
    return Math.abs(section.top - panel.top) < 40;
  });
  // A missing value is not a minus sign.
  assert.deepEqual(new Set(await page.$$eval("#plots figcaption .is-number", (values) => values.map(({ textContent }) => textContent))), new Set(["n/a"]));
  // The value of a joint's bar is available as text.
  const bar = await page.waitForSelector(".joint[aria-valuetext]");
  assert.match(await bar.getAttribute("aria-valuetext"), /^-?\d\.\d\d rad \(limits -?\d\.\d\d to -?\d\.\d\d\)$/);
  // The worker has handled all earlier requests.
  const before = await page.inputValue("#pose-x");
  await page.click("#new-pose");
  await page.waitForFunction((x) => document.getElementById("pose-x").value !== x, before);
  assert.notEqual(await page.textContent("#rate"), "Paused");
  assert.deepEqual(await a11yViolations(page), []);
  await page.close();
});

for (const colorScheme of ["light", "dark"]) {
  test(`dialogs, error cards and bottom sheet are accessible, ${colorScheme}`, async () => {
    const { page } = await visit(served, { colorScheme });
    await untilReady(page);
    await page.keyboard.press("?");
    await page.waitForSelector("#help", { state: "visible" });
    assert.deepEqual(await a11yViolations(page), [], "help dialog");
    await screenshot(page, `help-${colorScheme}`);
    await page.keyboard.press("Escape");
    await page.click("#check-open");
    await page.waitForSelector("dialog.check");
    assert.deepEqual(await a11yViolations(page), [], "self-check");
    await screenshot(page, `check-${colorScheme}`);
    await page.keyboard.press("Escape");
    await page.setInputFiles("#file", { name: "bad.obj", mimeType: "model/obj", buffer: Buffer.from("v 1") });
    await page.waitForSelector(".failure");
    assert.deepEqual(await a11yViolations(page), [], "error card");
    await page.setViewportSize(PHONE);
    await page.click("#handle");
    await page.waitForSelector("#upload", { state: "visible" });
    assert.deepEqual(await a11yViolations(page), [], "bottom sheet");
    await screenshot(page, `phone-sheet-${colorScheme}`);
    await page.close();
  });
}

test("unsupported WebAssembly is reported with a hint", async () => {
  const { page } = await newPage(served);
  // A module with an unknown section, as SIMD is for a browser without support.
  const body = Buffer.from([0, 97, 115, 109, 1, 0, 0, 0, 99, 1, 0]);
  await page.route("**/*.wasm", (route) => route.fulfill({ body, contentType: "application/wasm" }));
  await page.goto(served.address);
  const card = await page.waitForSelector("[data-code=wasm_unsupported]");
  await screenshot(page, "unsupported");
  assert.ok((await card.textContent()).length > 40);
  for (const button of ["#grasp", "#new-pose", "#search", "#batch-run", "#upload"]) assert.ok(await page.isDisabled(button), button);
  await page.close();
});

test("self-check lists missing features", async () => {
  const { page } = await newPage(served);
  await page.addInitScript(() => delete globalThis.WebAssembly);
  await page.goto(`${served.address}?check`);
  const missing = await page.waitForSelector("dialog.check .is-bad");
  assert.match(await missing.textContent(), /^WebAssembly/);
  await page.close();
});

test("settings open as a bottom sheet on a phone", async () => {
  const { page } = await visit(served, { viewport: PHONE });
  assert.equal(await page.isVisible("#upload"), false);
  await page.click("#handle");
  await page.waitForSelector("#upload", { state: "visible" });
  await screenshot(page, "phone-sheet");
  await page.close();
});

test("object can be dragged on the table", async () => {
  const { page } = await visit(served);
  await untilReady(page);
  const [x, y] = await page.evaluate(findObject);
  const before = await page.inputValue("#pose-y");
  await page.mouse.move(x, y);
  await page.mouse.down();
  await page.mouse.move(x + 20, y, { steps: 4 });
  await page.mouse.move(x + 60, y, { steps: 4 });
  await page.mouse.up();
  await page.waitForFunction((y) => document.getElementById("pose-y").value !== y, before);
  await page.close();
});

// Runs in the page: number of grid points at which the object can be grabbed.
function sizeOfObject() {
  const canvas = document.getElementById("view");
  const { width, height } = canvas.getBoundingClientRect();
  let size = 0;
  for (let y = 0; y < height; y += 8) {
    for (let x = 0; x < width; x += 8) {
      canvas.dispatchEvent(new PointerEvent("pointermove", { clientX: x, clientY: y, pointerType: "mouse" }));
      if (canvas.style.cursor === "grab") size += 1;
    }
  }
  return size;
}

test("one finger moves the object, two fingers zoom and leave it in place", async () => {
  const { page, errors } = await visit(served, { viewport: PHONE });
  await untilReady(page);
  const session = await page.context().newCDPSession(page);
  const touch = (type, ...points) =>
    session.send("Input.dispatchTouchEvent", { type, touchPoints: points.map(([x, y], id) => ({ x, y, id })) });
  const pose = () => page.$$eval("#pose-x, #pose-y, #pose-yaw", (inputs) => inputs.map(({ value }) => value).join());
  const [x, y] = await page.evaluate(findObject);
  const [before, size] = [await pose(), await page.evaluate(sizeOfObject)];

  // The first finger touches the object and moves slightly before the second one.
  await touch("touchStart", [x, y]);
  await touch("touchMove", [x + 4, y + 2]);
  await touch("touchStart", [x + 4, y + 2], [x + 40, y + 40]);
  for (let k = 1; k <= 6; k += 1) await touch("touchMove", [x + 4 - 8 * k, y + 2 - 8 * k], [x + 40 + 8 * k, y + 40 + 8 * k]);
  await touch("touchEnd");
  let zoomed = size;
  for (let k = 0; k < 100 && zoomed <= 1.3 * size; k += 1) zoomed = await page.evaluate(sizeOfObject);
  assert.ok(zoomed > 1.3 * size, `${zoomed} points, before ${size}`);
  assert.equal(await pose(), before);

  const [at, height] = await page.evaluate(findObject);
  await touch("touchStart", [at, height]);
  for (let k = 1; k <= 6; k += 1) await touch("touchMove", [at + 8 * k, height]);
  await touch("touchEnd");
  await page.waitForFunction((y) => document.getElementById("pose-y").value !== y, before.split(",")[1]);
  assert.deepEqual(errors, []);
  await page.close();
});
