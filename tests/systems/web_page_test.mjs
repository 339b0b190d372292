// An exported page in real browsers: Debian's Chromium, which draws on Mesa under Xvfb, and Firefox. Both are driven by
// puppeteer-core, which `npm ci` has put into web/node_modules. The pictures are compared with those of `xraycast render`.
// The program and the folder web/ are named by the environment: XRAYCAST_WEB_TEST and XRAYCAST_WEB.
import assert from "node:assert/strict";
import { execFileSync, spawn } from "node:child_process";
import { existsSync, mkdtempSync, readFileSync, rmSync, statSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";
import { after, before, test } from "node:test";
import { pathToFileURL } from "node:url";

const { XRAYCAST_WEB_TEST: program, XRAYCAST_WEB: web } = process.env;
const require = createRequire(pathToFileURL(join(resolve(web), "package.json")));
const puppeteer = require("puppeteer-core");
const { PNG } = require("pngjs");
const gltf_validator = require("gltf-validator");

const folder = mkdtempSync(join(tmpdir(), "xraycast-web-"));
const file = (name) => join(folder, name);
const run = (...words) => execFileSync(program, words.map(String), { encoding: "utf8", stdio: ["ignore", "pipe", "ignore"] });
const wait = (ms) => new Promise((done) => setTimeout(done, ms));

let screen, chromium;

/** A display of our own. */
async function start_screen() {
  screen = spawn("Xvfb", ["-displayfd", "3", "-screen", "0", "1280x1024x24", "-nolisten", "tcp"], { stdio: ["ignore", "ignore", "ignore", "pipe"] });
  const number = await new Promise((done, failed) => {
    screen.stdio[3].once("data", (text) => done(String(text).trim()));
    screen.once("error", failed);
    screen.once("exit", () => failed(new Error("Xvfb did not start")));
  });
  process.env.DISPLAY = `:${number}`;
}

const kMesa = ["--use-gl=angle", "--use-angle=gl", "--ignore-gpu-blocklist"];
const launch = (...flags) =>
  puppeteer.launch({ executablePath: "/usr/bin/chromium", headless: false, defaultViewport: null, args: ["--no-sandbox", "--disable-dev-shm-usage", ...flags] });

before(async () => {
  run("phantom", "thorax", "--size", "192x192x240", "-o", file("thorax.nrrd"), "--truth", file("truth"));
  run("cast", file("thorax.nrrd"), "-o", file("map.exr"), "--layers", 8);
  run("cast", file("thorax.nrrd"), "-o", file("circles.exr"), "--layers", 8, "--outline", "circle");
  writeFileSync(file("push.csv"), "time_s,insertion_mm,rotation_deg\n0,0,0\n3,150,180\n");
  run("export", file("map.exr"), "--vessels", file("truth"), "-o", file("page.html"));
  run("export", file("circles.exr"), "--vessels", file("truth"), "--precision", "half", "-o", file("circles.html"));
  run("export", file("map.exr"), "--vessels", file("truth"), "--script", file("push.csv"), "--title", "A <run> & its film", "-o", file("run.html"));
  await start_screen();
  chromium = await launch(...kMesa);
});

after(async () => {
  await chromium?.close();
  screen?.kill();
  rmSync(folder, { recursive: true });
});

const address = (name, hash) => `${pathToFileURL(file(name))}#${hash}`;
const pictures = (page) => page.evaluate(() => Number(document.documentElement.dataset.pictures ?? 0));

/** Waits for a picture that is drawn fully. */
async function settled(page) {
  for (let last = -1, now = await pictures(page); last !== now || now === 0; now = await pictures(page)) {
    last = now;
    await wait(250);
  }
}

/** Opens a page, and keeps what must not happen. */
async function open(name, hash, { width = 640, height = 480, browser = chromium } = {}) {
  const page = await browser.newPage(), failures = [];
  await page.setViewport({ width, height });
  page.on("pageerror", (error) => failures.push(`error: ${error.message}`));
  page.on("console", (message) => message.type() === "error" && failures.push(`console: ${message.text()}`));
  page.on("request", (request) => /^(file|data|blob):/.test(request.url()) || failures.push(`request: ${request.url()}`));
  await page.goto(address(name, hash));
  await page.waitForFunction(() => document.documentElement.dataset.pictures, { timeout: 120000 });
  await settled(page);
  return { page, failures };
}

async function close({ page, failures }) {
  assert.deepEqual(failures, []);
  await page.close();
}

async function show(page, hash) {
  const drawn = await pictures(page);
  await page.evaluate((hash) => (location.hash = hash), hash);
  await page.waitForFunction((drawn) => Number(document.documentElement.dataset.pictures) > drawn, {}, drawn);
  await settled(page);
}

const picture_of = async (page) => PNG.sync.read(Buffer.from(await page.screenshot({ type: "png" })));

/** Over all channels, of a peak of 255. */
function psnr_dB(a, b) {
  assert.deepEqual([a.width, a.height], [b.width, b.height]);
  let sum = 0, count = 0;
  for (let i = 0; i < a.data.length; ++i) if (i % 4 < 3) (sum += (a.data[i] - b.data[i]) ** 2), ++count;
  return 10 * Math.log10(255 ** 2 / Math.max(sum / count, 1e-9));
}

function deviation(picture) {
  const greys = picture.data.filter((_, i) => i % 4 === 0), mean = greys.reduce((a, b) => a + b) / greys.length;
  return Math.sqrt(greys.reduce((sum, grey) => sum + (grey - mean) ** 2, 0) / greys.length);
}

/** The lowest PSNR of a page's pictures against those of `render`. */
async function lowest_psnr_dB(name, map, { sizes, looks, views, browser }) {
  let lowest = Infinity;
  for (const [width, height] of sizes) {
    const opened = await open(name, "ui=0", { width, height, browser });
    for (const look of looks)
      for (const [lao, cranial] of views) {
        run("render", file(map), "-o", file("frame.png"), "--vessels", file("truth"), "--look", look, "--angle", lao, "--tilt", cranial, "--size", `${width}x${height}`);
        await show(opened.page, `lao=${lao}&cranial=${cranial}&look=${look}&ui=0`);
        const shown = await picture_of(opened.page), dB = psnr_dB(shown, PNG.sync.read(readFileSync(file("frame.png"))));
        assert.ok(deviation(shown) > 12, `${look} ${lao} ${cranial}: flat`);
        assert.ok(dB >= 40, `${look}, LAO ${lao}, cranial ${cranial}, ${width} x ${height}: ${dB.toFixed(1)} dB`);
        lowest = Math.min(lowest, dB);
      }
    await close(opened);
  }
  return lowest;
}

const kSizes = [[640, 480], [360, 560]], kLooks = ["fluoro", "surface"];
const kViews = Array.from({ length: 12 }, (_, i) => [30 * i, i % 3 === 0 ? 0 : 10 * ((i % 5) - 2)]);

test("the committed page is what its sources make", () => {
  execFileSync(process.execPath, [join(web, "build.mjs"), file("built.html")]);
  assert.ok(readFileSync(file("built.html")).equals(readFileSync(join(web, "page.html"))), "web/page.html is not up to date; run `npm run build` in web/");
});

test("the sources' types agree", () => {
  execFileSync(process.execPath, [join(web, "node_modules/typescript/bin/tsc"), "--noEmit", "-p", web], { stdio: "pipe" });
});

test("a live context draws a picture that is not flat", async (t) => {
  const opened = await open("page.html", "ui=0");
  const device = await opened.page.evaluate(() => {
    const gl = document.getElementById("picture").getContext("webgl2"), names = gl.getExtension("WEBGL_debug_renderer_info");
    return gl.isContextLost() ? "" : gl.getParameter(names ? names.UNMASKED_RENDERER_WEBGL : gl.RENDERER);
  });
  t.diagnostic(`drawn by ${device}`);
  assert.ok(device);
  assert.ok(deviation(await picture_of(opened.page)) > 12);
  await close(opened);
});

test("pictures are those of render, from 12 sides in both looks and two sizes", async (t) => {
  t.diagnostic(`lowest PSNR ${(await lowest_psnr_dB("page.html", "map.exr", { sizes: kSizes, looks: kLooks, views: kViews })).toFixed(1)} dB`);
});

test("so are those of circles and of 16-bit floats", async (t) => {
  const views = kViews.filter((_, i) => i % 3 === 1);
  t.diagnostic(`lowest PSNR ${(await lowest_psnr_dB("circles.html", "circles.exr", { sizes: [kSizes[0]], looks: kLooks, views })).toFixed(1)} dB`);
});

test("drag, wheel, pinch and keys move the C-arm", async () => {
  const opened = await open("page.html", "lao=0", { width: 900, height: 700 }), { page } = opened;
  const readout = () => page.$eval("#readout", (element) => element.textContent);
  const stage = await (await page.$("#stage")).boundingBox(), x = stage.x + stage.width / 2, y = stage.y + stage.height / 2;
  assert.match(await readout(), /^AP /);
  await page.mouse.move(x, y);
  await page.mouse.down();
  await page.mouse.move(x - 50, y + 25, { steps: 5 });
  await page.mouse.up();
  await settled(page);
  assert.match(await readout(), /^LAO 20 \/ CRA 10 /);
  await page.mouse.wheel({ deltaY: -400 });
  await settled(page);
  assert.match(await readout(), /×1\.5$/);
  await page.keyboard.press("ArrowRight");
  await page.keyboard.press("PageUp");
  await settled(page);
  assert.match(await readout(), /^LAO 15 \/ CRA 10 .*table \+[1-9]/);
  await page.keyboard.press("r");
  await settled(page);
  assert.match(await readout(), /^AP   table \+0 mm   ×1$/);
  const hands = await page.createCDPSession(), finger = (id, x, y) => ({ id, x, y });
  const touch = (type, touchPoints) => hands.send("Input.dispatchTouchEvent", { type, touchPoints });
  await touch("touchStart", [finger(1, x - 40, y), finger(2, x + 40, y)]);
  for (const apart of [50, 60, 70, 80]) await touch("touchMove", [finger(1, x - apart, y), finger(2, x + apart, y)]);
  await touch("touchEnd", []);
  await settled(page);
  assert.match(await readout(), /×2$/);
  const is_automatic = () => page.$eval("#auto-window", (button) => button.getAttribute("aria-pressed"));
  assert.equal(await is_automatic(), "true");
  await touch("touchStart", [finger(1, x - 40, y), finger(2, x + 40, y)]);
  for (const down of [10, 20, 30]) await touch("touchMove", [finger(1, x - 40, y + down), finger(2, x + 40, y + down)]);
  await touch("touchEnd", []);
  await settled(page);
  assert.equal(await is_automatic(), "false");
  await page.keyboard.press("w");
  assert.equal(await is_automatic(), "true");
  await page.keyboard.press("f");
  assert.equal(await page.$eval("#surface", (button) => button.getAttribute("aria-pressed")), "true");
  await page.keyboard.press("2");
  assert.equal(await page.$$eval("#layers input", (layers) => layers.filter((layer) => !layer.checked).length), 1);
  await close(opened);
});

test("the run plays, is scrubbed, and says its forces", async () => {
  const opened = await open("run.html", "lao=0", { width: 900, height: 700 }), { page } = opened;
  assert.equal(await page.title(), "A <run> & its film");
  const time = () => page.$eval("#time", (range) => Number(range.value));
  const before = await picture_of(page);
  await page.click("#play");
  await wait(1500);
  await page.click("#play");
  const played = await time();
  assert.ok(played > 0.3 && played < 3, `${played} s`);
  await settled(page);
  assert.ok(psnr_dB(before, await picture_of(page)) < 60);
  await page.focus("#time");
  await page.keyboard.press("End");
  await settled(page);
  assert.ok(Math.abs((await time()) - 3) < 0.1);
  assert.match(await page.$eval("#strip", (strip) => strip.getAttribute("aria-label")), /force .* N, torque .* mN m, over 3\.0 s/);
  await close(opened);
});

test("a link goes to a view, and pictures are saved", async () => {
  const opened = await open("page.html", "lao=30&cranial=-10&zoom=1.5&table=20&look=surface", { width: 900, height: 700 }), { page } = opened;
  assert.equal(await page.$eval("#readout", (element) => element.textContent), "LAO 30 / CAU 10   table +20 mm   ×1.5");
  await page.keyboard.press("ArrowLeft");
  await page.click("#copy");
  await wait(100);
  assert.equal(new URL(page.url()).hash, "#lao=35&cranial=-10&zoom=1.5&table=20&look=surface");
  const session = await page.createCDPSession();
  await session.send("Browser.setDownloadBehavior", { behavior: "allow", downloadPath: folder });
  await page.click("#save");
  for (let i = 0; i < 50 && !existsSync(file("lao-35-cau-10.png")); ++i) await wait(100);
  assert.ok(statSync(file("lao-35-cau-10.png")).size > 5000);
  await close(opened);
});

test("a lost context comes back", async () => {
  const opened = await open("page.html", "ui=0&lao=40"), { page } = opened, before = await picture_of(page);
  await page.evaluate(async () => {
    const lose = document.getElementById("picture").getContext("webgl2").getExtension("WEBGL_lose_context");
    lose.loseContext();
    await new Promise((done) => setTimeout(done, 200));
    lose.restoreContext();
    await new Promise((done) => setTimeout(done, 1500));
  });
  assert.ok(psnr_dB(before, await picture_of(page)) > 60);
  await page.close();
});

test("without WebGL 2 there are a line and a still picture", async () => {
  const browser = await launch("--disable-gpu", "--disable-3d-apis");
  const page = await browser.newPage();
  await page.goto(address("page.html", ""));
  await page.waitForFunction(() => document.getElementById("note").textContent.includes("still picture"));
  assert.ok(await page.$eval("#still", (still) => !still.hidden && still.naturalWidth === 480 && still.alt !== ""));
  await browser.close();
});

test("nothing is wider than 360 pixels", async () => {
  for (const scheme of ["light", "dark"]) {
    const opened = await open("run.html", "lao=20", { width: 360, height: 740 }), { page } = opened;
    await page.emulateMediaFeatures([{ name: "prefers-color-scheme", value: scheme }]);
    assert.equal(await page.evaluate(() => document.documentElement.scrollWidth), 360);
    assert.match(await page.$eval("footer", (footer) => footer.textContent), /Not for clinical use/);
    await close(opened);
  }
});

test("pictures are drawn fast enough to turn", async (t) => {
  const opened = await open("circles.html", "ui=0&vessels=0");
  const per_s = await opened.page.evaluate(async () => {
    const drawn = () => Number(document.documentElement.dataset.pictures), from = drawn(), start = performance.now();
    for (let lao = 0; performance.now() - start < 4000; lao += 2) {
      location.hash = `lao=${lao}&ui=0&vessels=0`;
      await new Promise(requestAnimationFrame);
    }
    return (1000 * (drawn() - from)) / (performance.now() - start);
  });
  t.diagnostic(`${per_s.toFixed(1)} pictures/s of 8 layers at 640 x 480, in full resolution`);
  assert.ok(per_s > 5, `${per_s} pictures/s`); // far below what idle cores draw: tests share them
  await close(opened);
});

test("opening a page again and again takes no more memory", async (t) => {
  const page = await chromium.newPage(), used_MB = async () => {
    const session = await page.createCDPSession();
    await session.send("HeapProfiler.collectGarbage");
    const { usedSize } = await session.send("Runtime.getHeapUsage");
    await session.detach();
    return usedSize / 1e6;
  };
  const open_again = async (count) => {
    for (let i = 0; i < count; ++i) {
      await page.goto(address("page.html", "ui=0"));
      await page.waitForFunction(() => document.documentElement.dataset.pictures, { timeout: 120000 });
      await page.goto("about:blank");
    }
  };
  await open_again(20);
  const early_MB = await used_MB();
  await open_again(180);
  const late_MB = await used_MB();
  t.diagnostic(`${early_MB.toFixed(1)} MB after 20 openings, ${late_MB.toFixed(1)} MB after 200`);
  assert.ok(late_MB < early_MB + 5); // a page alone takes more
  await page.close();
});

test("glTF files are valid", async () => {
  for (const words of [[], ["--vessels", file("truth")], ["--vessels", file("truth"), "--script", file("push.csv")]]) {
    run("export", file("map.exr"), ...words, "-o", file("session.glb"));
    const { issues } = await gltf_validator.validateBytes(new Uint8Array(readFileSync(file("session.glb"))));
    assert.deepEqual([issues.numErrors, issues.numWarnings], [0, 0], JSON.stringify(issues.messages.slice(0, 5)));
  }
});

test("Firefox shows the same pictures", { skip: !existsSync("/usr/bin/firefox-esr") && "there is no firefox-esr" }, async (t) => {
  const firefox = await puppeteer.launch({
    browser: "firefox", executablePath: "/usr/bin/firefox-esr", headless: true, extraPrefsFirefox: { "webgl.force-enabled": true },
  });
  try {
    const views = kViews.filter((_, i) => i % 4 === 1);
    const dB = await lowest_psnr_dB("page.html", "map.exr", { sizes: [kSizes[0]], looks: kLooks, views, browser: firefox });
    t.diagnostic(`lowest PSNR ${dB.toFixed(1)} dB`);
  } finally {
    await firefox.close();
  }
});
