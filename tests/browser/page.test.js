// The page as one meets it: it draws, keeps to its policy, and fits wide and narrow windows.

import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { barriers, blank, findObject, open, PHONE, screenshot, untilReady, visit, WIDE } from "./chromium.js";

let served;
before(async () => (served = await open()));
after(() => served?.close());

for (const [shape, viewport] of Object.entries({ wide: WIDE, phone: PHONE })) {
  for (const colorScheme of ["light", "dark"]) {
    test(`it draws without complaint, ${shape} and ${colorScheme}`, async () => {
      const { page, complaints } = await visit(served, { viewport, colorScheme });
      await untilReady(page);
      const ground = await page.evaluate(() => getComputedStyle(document.body).backgroundColor);
      const brightness = Math.max(...ground.match(/\d+/g).map(Number));
      assert.equal(brightness < 128, colorScheme === "dark", ground);
      await screenshot(page, `${shape}-${colorScheme}`);
      assert.deepEqual(complaints, []);
      await page.close();
    });
  }
}

// Visible controls that reach out of the window, out of their box, or over one another.
const misplaced = () => {
  const named = (control) => control.id || control.value || control.textContent;
  const isIn = (inner, outer) =>
    inner.left >= outer.left - 1 && inner.right <= outer.right + 1 && inner.top >= outer.top - 1;
  const controls = [...document.querySelectorAll(".dock button, .dock select, .cameras button, h1")].filter(
    (control) => control.checkVisibility({ visibilityProperty: true }),
  );
  const boxes = controls.map((control) => control.getBoundingClientRect());
  const screen = { left: 0, right: innerWidth, top: 0 };
  const found = [];
  // Narrow, the dock is as wide as the window.
  const dock = document.querySelector(".dock").getBoundingClientRect();
  if (innerWidth < 800 && dock.width < innerWidth - 1) found.push(`the dock is ${dock.width} pixels wide`);
  controls.forEach((control, i) => {
    const home = control.closest(".dock")?.getBoundingClientRect() ?? screen;
    if (!isIn(boxes[i], screen) || !isIn(boxes[i], home)) found.push(`${named(control)} is cut off`);
    if (boxes[i].bottom > innerHeight + 1) found.push(`${named(control)} is below the window`);
    if (control.scrollWidth > control.clientWidth + 1) found.push(`${named(control)} does not fit its button`);
    for (let j = 0; j < i; j++) {
      const apart =
        boxes[i].left >= boxes[j].right - 1 ||
        boxes[j].left >= boxes[i].right - 1 ||
        boxes[i].top >= boxes[j].bottom - 1 ||
        boxes[j].top >= boxes[i].bottom - 1;
      if (!apart) found.push(`${named(control)} lies over ${named(controls[j])}`);
    }
  });
  // Below the fold of a panel that scrolls, what counts is the width.
  for (const section of document.querySelectorAll(".panel > section")) {
    const room = section.getBoundingClientRect();
    for (const part of section.querySelectorAll("label, label span, button, input, select, dd, p")) {
      if (!part.checkVisibility({ visibilityProperty: true })) continue;
      if (part.getBoundingClientRect().right > room.right + 1) found.push(`${named(part)} reaches out of the panel`);
      if (part.matches("span") && part.scrollWidth > part.clientWidth) found.push(`${named(part)} is cut short`);
    }
  }
  return found;
};

test("every control has its place at every width", async () => {
  const { page } = await visit(served);
  await untilReady(page);
  for (const width of [320, 390, 640, 700, 768, 800, 900, 960, 1060, 1440]) {
    await page.setViewportSize({ width, height: 800 });
    assert.deepEqual(await page.evaluate(misplaced), [], `${width} pixels wide`);
  }
  await page.setViewportSize({ width: 768, height: 1024 });
  await screenshot(page, "tablet");
  await page.close();
});

test("the content security policy forbids eval and foreign scripts", async () => {
  const { page } = await visit(served);
  const [evaluated, refused] = await page.evaluate(() => {
    const refused = [];
    addEventListener("securitypolicyviolation", (event) => refused.push(event.effectiveDirective));
    const script = document.createElement("script");
    script.src = "https://example.invalid/script.js";
    document.head.append(script);
    // Later, because what the test itself evaluates is exempt.
    setTimeout("globalThis.evaluated = true");
    return new Promise((resolve) => setTimeout(() => resolve([globalThis.evaluated, refused]), 200));
  });
  assert.equal(evaluated, undefined);
  assert.deepEqual(new Set(refused), new Set(["script-src", "script-src-elem"]));
  assert.equal(await page.evaluate(() => crossOriginIsolated), true);
  await page.close();
});

test("keys do what the buttons do", async () => {
  const { page } = await visit(served);
  await untilReady(page);
  await page.keyboard.press("?");
  assert.ok(await page.isVisible("#help"));
  await page.keyboard.press("Escape");
  await page.waitForSelector("#help", { state: "hidden" });
  const before = await page.inputValue("#pose-x");
  await page.keyboard.press("ArrowUp");
  await page.waitForFunction((x) => document.getElementById("pose-x").value !== x, before);
  // The focus leaves a dialog a moment after it has closed: that key counts, too.
  await page.evaluate(() => {
    const key = new KeyboardEvent("keydown", { key: "ArrowDown", bubbles: true });
    document.querySelector("#help button").dispatchEvent(key);
  });
  await page.waitForFunction((x) => document.getElementById("pose-x").value === x, before);
  const turned = await page.inputValue("#pose-yaw");
  await page.keyboard.press("r");
  await page.waitForFunction((yaw) => document.getElementById("pose-yaw").value !== yaw, turned);
  await page.keyboard.press(" ");
  await page.waitForFunction(() => document.getElementById("rate").textContent === "Paused");
  const layers = { c: "cloud", m: "reconstruction", h: "hulls", f: "forces", t: "trail", j: "target", k: "limits", s: "sensor" };
  for (const [key, layer] of Object.entries(layers)) {
    const was = await page.isChecked(`#layer-${layer}`);
    await page.keyboard.press(key);
    assert.equal(await page.isChecked(`#layer-${layer}`), !was, layer);
  }
  await page.keyboard.press("i");
  await page.waitForSelector("#inside[open]");
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
  // With Shift the arrows turn the viewer, and the object stays.
  const stands = () => page.$eval("#pose", (fields) => [...fields.querySelectorAll("input")].map((input) => input.value).join());
  const stood = await stands();
  const pictures = [];
  for (const key of ["", "Shift+ArrowRight", "Shift+ArrowUp", "+"]) {
    if (key) await page.keyboard.press(key);
    await page.waitForTimeout(700);
    pictures.push((await page.locator("#view").screenshot()).toString("base64"));
  }
  assert.equal(new Set(pictures).size, 4, "each key shows something else");
  assert.equal(await stands(), stood);
  // An attempt that is paused goes on step by step, and back.
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

test("keys can be turned off, and stay so", async () => {
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
  // What was pressed before did nothing, and was heard by now.
  assert.notEqual(await page.textContent("#rate"), "Paused");
  await page.keyboard.press("?");
  assert.ok(await page.isVisible("#help"));
  await page.close();
});

test("a camera is no longer marked when somebody looks elsewhere", async () => {
  const { page } = await visit(served);
  await untilReady(page);
  const top = "#cameras [value=top]";
  for (const look of [() => page.keyboard.press("Shift+ArrowLeft"), () => page.mouse.wheel(0, 100)]) {
    await page.click(top);
    await page.waitForSelector(`${top}[aria-pressed=true]`);
    await page.hover("#view", { position: { x: 40, y: 300 } });
    await page.evaluate(() => document.activeElement.blur());
    await look();
    await page.waitForSelector(`${top}[aria-pressed=false]`);
  }
  await page.close();
});

test("Space opens what is closed where the focus is, and pauses nothing then", async () => {
  const { page } = await visit(served);
  await untilReady(page);
  await page.focus("#inside summary");
  await page.keyboard.press(" ");
  await page.waitForSelector("#inside[open]");
  // What a joint's bar shows is there as text.
  const bar = await page.waitForSelector(".joint[aria-valuetext]");
  assert.match(await bar.getAttribute("aria-valuetext"), /^-?\d\.\d\d rad, from -?\d\.\d\d to -?\d\.\d\d$/);
  // The worker has heard all that was asked of it before.
  const before = await page.inputValue("#pose-x");
  await page.click("#new-pose");
  await page.waitForFunction((x) => document.getElementById("pose-x").value !== x, before);
  assert.notEqual(await page.textContent("#rate"), "Paused");
  assert.deepEqual(await barriers(page), []);
  await page.close();
});

for (const colorScheme of ["light", "dark"]) {
  test(`nothing bars anybody from what opens over the page, ${colorScheme}`, async () => {
    const { page } = await visit(served, { colorScheme });
    await untilReady(page);
    await page.keyboard.press("?");
    await page.waitForSelector("#help", { state: "visible" });
    assert.deepEqual(await barriers(page), [], "the keys");
    await screenshot(page, `help-${colorScheme}`);
    await page.keyboard.press("Escape");
    await page.click("#check-open");
    await page.waitForSelector("dialog.check");
    assert.deepEqual(await barriers(page), [], "the self-check");
    await screenshot(page, `check-${colorScheme}`);
    await page.keyboard.press("Escape");
    await page.setInputFiles("#file", { name: "bad.obj", mimeType: "model/obj", buffer: Buffer.from("v 1") });
    await page.waitForSelector(".failure");
    assert.deepEqual(await barriers(page), [], "a failure");
    await page.setViewportSize(PHONE);
    await page.click("#handle");
    await page.waitForSelector("#upload", { state: "visible" });
    assert.deepEqual(await barriers(page), [], "the sheet");
    await screenshot(page, `phone-sheet-${colorScheme}`);
    await page.close();
  });
}

test("an engine that a browser does not understand is told, with what to do", async () => {
  const { page } = await blank(served);
  // A section of a kind that there is none of, as SIMD is to a browser without it.
  const body = Buffer.from([0, 97, 115, 109, 1, 0, 0, 0, 99, 1, 0]);
  await page.route("**/*.wasm", (route) => route.fulfill({ body, contentType: "application/wasm" }));
  await page.goto(served.address);
  const card = await page.waitForSelector("[data-code=wasm_unsupported]");
  await screenshot(page, "unsupported");
  assert.ok((await card.textContent()).length > 40);
  for (const button of ["#grasp", "#new-pose", "#search", "#batch-run", "#upload"]) assert.ok(await page.isDisabled(button), button);
  await page.close();
});

test("the self-check says what is missing", async () => {
  const { page } = await blank(served);
  await page.addInitScript(() => delete globalThis.WebAssembly);
  await page.goto(`${served.address}?check`);
  const missing = await page.waitForSelector("dialog.check .is-bad");
  assert.match(await missing.textContent(), /^WebAssembly/);
  await page.close();
});

test("on a phone the settings open as a sheet", async () => {
  const { page } = await visit(served, { viewport: PHONE });
  assert.equal(await page.isVisible("#upload"), false);
  await page.click("#handle");
  await page.waitForSelector("#upload", { state: "visible" });
  await screenshot(page, "phone-sheet");
  await page.close();
});

test("the object is dragged over the table", async () => {
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

// Runs in the page: over how much of the view (points of a grid) the object can be grabbed.
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

test("one finger moves the object, two come nearer and leave it where it is", async () => {
  const { page, complaints } = await visit(served, { viewport: PHONE });
  await untilReady(page);
  const session = await page.context().newCDPSession(page);
  const touch = (type, ...points) =>
    session.send("Input.dispatchTouchEvent", { type, touchPoints: points.map(([x, y], id) => ({ x, y, id })) });
  const pose = () => page.$$eval("#pose-x, #pose-y, #pose-yaw", (inputs) => inputs.map(({ value }) => value).join());
  const [x, y] = await page.evaluate(findObject);
  const [before, size] = [await pose(), await page.evaluate(sizeOfObject)];

  // The first finger of a hand lands on the object and trembles before the second comes.
  await touch("touchStart", [x, y]);
  await touch("touchMove", [x + 4, y + 2]);
  await touch("touchStart", [x + 4, y + 2], [x + 40, y + 40]);
  for (let k = 1; k <= 6; k += 1) await touch("touchMove", [x + 4 - 8 * k, y + 2 - 8 * k], [x + 40 + 8 * k, y + 40 + 8 * k]);
  await touch("touchEnd");
  let nearer = size;
  for (let k = 0; k < 100 && nearer <= 1.3 * size; k += 1) nearer = await page.evaluate(sizeOfObject);
  assert.ok(nearer > 1.3 * size, `${nearer} points after ${size}`);
  assert.equal(await pose(), before);

  const [at, height] = await page.evaluate(findObject);
  await touch("touchStart", [at, height]);
  for (let k = 1; k <= 6; k += 1) await touch("touchMove", [at + 8 * k, height]);
  await touch("touchEnd");
  await page.waitForFunction((y) => document.getElementById("pose-y").value !== y, before.split(",")[1]);
  assert.deepEqual(complaints, []);
  await page.close();
});
