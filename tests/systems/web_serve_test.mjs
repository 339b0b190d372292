// A live session of `xraycast serve --web` in Debian's Chromium, and in Firefox. The program and the folder web/ are named by
// the environment: XRAYCAST_WEB_TEST and XRAYCAST_WEB.
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { once } from "node:events";
import { existsSync, readFileSync, writeFileSync } from "node:fs";
import { createServer as create_http } from "node:http";
import { connect, createServer } from "node:net";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { browser_test, chromium, end_chromium, kMesa, puppeteer, start_chromium } from "./chromium.mjs";
import { PNG, file, program, remove_folder, run, wait } from "./web_folder.mjs";

const { XRAYCAST_WEB: web } = process.env;

before(async () => {
  run("phantom", "thorax", "--size", "96x96x120", "-o", file("thorax.nrrd"), "--truth", file("truth"));
  run("cast", file("thorax.nrrd"), "-o", file("map.exr"), "--layers", 4);
  run("phantom", "thorax", "--size", "64x64x80", "-o", file("rest.nrrd"), "--truth", file("rest"), "--motion", file("motion"));
  run("cast", file("rest.nrrd"), "-o", file("moving.exr"), "--layers", 4, "--angles", 90, "--motion", file("motion/motion.json"), "--keys", "breath=2", "--keys", "heart=6");
  await start_chromium(...kMesa, "--host-resolver-rules=MAP rebound.example 127.0.0.1");
});

after(async () => {
  await end_chromium();
  for (const server of servers) server.kill("SIGKILL"); // of tests that failed
  remove_folder();
});

const servers = new Set();

/** A session that is served, and the address of its page. */
const serve = (...words) => serve_map("map.exr", "truth", ...words);

async function serve_map(map, vessels, ...words) {
  const server = spawn(program, ["serve", file(map), "--vessels", file(vessels), "--listen", "127.0.0.1:0", "--web", ...words], { stdio: ["ignore", "ignore", "pipe"] });
  servers.add(server);
  server.once("exit", () => servers.delete(server));
  let said = "";
  const address = await new Promise((done, failed) => {
    server.stderr.on("data", (text) => {
      said += text;
      const found = said.match(/open (http:\S+) in a browser/);
      if (found) done(found[1]);
    });
    server.once("exit", () => failed(new Error(said)));
  });
  return { server, address, port: Number(new URL(address).port), log: () => said };
}

async function end({ server }) {
  const ended = once(server, "exit");
  server.kill("SIGTERM");
  return (await ended)[0];
}

const kPair = ["--device-model", "cobra-5f", "--device-model", "guidewire-035-j"];

async function open(address, { width = 900, height = 760, browser = chromium(), touch = false } = {}) {
  const page = await browser.newPage(), failures = [];
  await page.setViewport({ width, height, hasTouch: touch });
  await page.evaluateOnNewDocument(() => {
    const { send } = WebSocket.prototype;
    window.said = []; // by the page to the server
    WebSocket.prototype.send = function (text) {
      window.said.push(JSON.parse(text));
      send.call(this, text);
    };
  });
  page.on("pageerror", (error) => failures.push(`error: ${error.message}`));
  page.on("request", (request) => /^(data|blob):/.test(request.url()) || request.url().startsWith(new URL(address).origin) || failures.push(`request: ${request.url()}`));
  await page.goto(address);
  await page.waitForFunction(() => document.documentElement.dataset.exposures, { timeout: 60000 });
  return { page, failures };
}

async function close({ page, failures }) {
  assert.deepEqual(failures, []);
  await page.close();
}

/** Waits until an element's text is as wanted, and says how it is where it does not become so. */
async function reads(page, selector, pattern) {
  await page.waitForFunction((selector, wanted) => new RegExp(wanted).test(document.querySelector(selector).textContent), { timeout: 20000 }, selector, pattern.source).catch(async () => {
    assert.fail(`${selector} reads "${await page.$eval(selector, (element) => element.textContent)}", not ${pattern}`);
  });
}

const insertion_mm = (page) => page.$eval("#live-readout", (readout) => Number(readout.textContent.match(/(-?\d+) mm/)?.[1] ?? NaN));
const c_arms_said = (page) => page.evaluate(() => window.said.flatMap(({ c_arm }) => c_arm ?? []));
const go_to = (page, hash) => page.evaluate((hash) => void (location.hash = hash), hash);

/** Waits until an instrument rests; the readout may be late by less than 0.7 s. */
async function rested_mm(page) {
  for (let tries = 0, last = NaN; tries < 30; ++tries) {
    const now = await insertion_mm(page);
    if (now === last) return now;
    last = now;
    await wait(700);
  }
  assert.fail("the instrument goes on");
}

const exposures = (page) => page.evaluate(() => Number(document.documentElement.dataset.exposures));

async function drawn(page) {
  return PNG.sync.read(Buffer.from(await (await page.$("#picture")).screenshot({ type: "png" })));
}

/** Pixels whose grey differs by more than noise, of which there is none. */
function changed(a, b) {
  let count = 0;
  for (let i = 0; i < a.data.length; i += 4) if (Math.abs(a.data[i] - b.data[i]) > 8) ++count;
  return count;
}

browser_test("the page shows how far the session's exercise is", async () => {
  const targets = [{ name: "near", at_mm: [88, -58, -325] }, { name: "far", at_mm: [6, -9, -52] }];
  writeFileSync(file("task.json"), JSON.stringify({ title: "In", task: "Go in.", instruments: ["cobra-5f"], entry: [89, -54, -357], targets, limits: { time_s: 0.5 } }));
  const session = await serve("--exercise", file("task.json"), "--report", file("report.json")), opened = await open(session.address), { page } = opened;
  await reads(page, "#live-role", /^You steer$/);
  await reads(page, "#exercise-task", /^In\. Go in\.$/);
  await reads(page, "#exercise-progress", /^▸ near○ far$/);
  assert.equal(await page.$eval("#exercise-choice", (choice) => choice.checkVisibility()), false); // the server has chosen
  await page.focus("#stage");
  await page.keyboard.down("ArrowUp");
  await reads(page, "#exercise-progress", /^✓ near: [\d.]+ s▸ far✗ time above 0.5 s: 0.5 s$/);
  await page.keyboard.up("ArrowUp");
  await close(opened);
  const late = await open(session.address);
  await reads(late.page, "#exercise-progress", /✓ near: /); // whoever comes later is told too
  await close(late);
  assert.equal(await end(session), 143);
  assert.notEqual(JSON.parse(readFileSync(file("report.json"), "utf8")).exercise.targets[0].reached_s, null);
});

browser_test("keys steer a wire in a catheter, and the picture follows while the pedal is down", async (t) => {
  const session = await serve(...kPair), opened = await open(`${session.address}#zoom=2.5&table=-200`), { page } = opened;
  await reads(page, "#live-role", /^You steer$/);
  await page.focus("#stage");
  const still = await drawn(page), first = await exposures(page);
  await page.keyboard.down("ArrowUp");
  await page.waitForFunction(() => Number(document.querySelector("#live-readout").textContent.match(/(-?\d+) mm/)?.[1]) >= 60, { timeout: 20000 });
  assert.equal(await exposures(page), first); // without the pedal the picture is held
  assert.equal(changed(still, await drawn(page)), 0);
  await go_to(page, "lao=40&zoom=2.5&table=-200"); // wherever the C-arm goes
  await reads(page, "#readout", /^LAO 40 .* picture AP$/);
  assert.equal(changed(still, await drawn(page)), 0);
  await page.keyboard.down("x");
  await reads(page, "#readout", /^LAO 40 .*×2.5$/);
  assert.ok(changed(still, await drawn(page)) > 1000);
  await go_to(page, "zoom=2.5&table=-200");
  await page.waitForFunction(() => Number(document.querySelector("#live-readout").textContent.match(/(-?\d+) mm/)?.[1]) >= 150, { timeout: 20000 });
  await page.keyboard.up("ArrowUp");
  await rested_mm(page);
  await reads(page, "#live-readout", /tip in (?!a vessel)[a-z ]*(artery|aorta|branch \d+) /);
  const moved = await drawn(page);
  t.diagnostic(`the catheter at ${await insertion_mm(page)} mm changes ${changed(still, moved)} pixels`);
  assert.ok(changed(still, moved) > 100);

  await page.select("#hub", "1");
  await wait(600); // some readouts
  assert.equal(await page.$eval("#hub", (choice) => choice.value), "1"); // the choice stays, until another instrument is held
  await page.select("#hub", "0");
  await page.keyboard.press("Tab");
  await reads(page, "#live-readout", /^guidewire-035-j 0 mm/);
  await page.keyboard.down("ArrowUp");
  await page.waitForFunction(() => Number(document.querySelector("#live-readout").textContent.match(/(-?\d+) mm/)?.[1]) >= 20, { timeout: 20000 });
  await page.keyboard.up("ArrowUp");
  assert.match(await page.$eval("#load-chart", (chart) => chart.getAttribute("aria-label")), /^At the hub of the guidewire-035-j: force /);
  await page.keyboard.down("i");
  await reads(page, "#live-readout", /no lumen is free, draw the wire back to 0 mm to inject; 0 ml/);
  await page.keyboard.up("i");
  await page.keyboard.press("v");
  await page.waitForFunction(() => document.querySelector("#valve").getAttribute("aria-pressed") === "true");
  await page.keyboard.up("x");
  await reads(page, "#live-readout", /held picture/);
  await close(opened);
  assert.equal(await end(session), 143);
});

browser_test("contrast agent is seen where it flows", async (t) => {
  const session = await serve("--device-model", "cobra-5f"), opened = await open(session.address), { page } = opened;
  await page.focus("#stage");
  await page.keyboard.down("x");
  await page.keyboard.down("ArrowUp");
  await page.waitForFunction(() => Number(document.querySelector("#live-readout").textContent.match(/(-?\d+) mm/)?.[1]) >= 200, { timeout: 30000 });
  await page.keyboard.up("ArrowUp");
  await rested_mm(page);
  const without = await drawn(page);
  await page.keyboard.down("i");
  await reads(page, "#live-readout", /injecting, ([5-9]|\d\d) ml/);
  const filled = await drawn(page);
  await page.keyboard.up("i");
  t.diagnostic(`${changed(without, filled)} pixels are darker by contrast agent`);
  assert.ok(changed(without, filled) > 300);
  await page.keyboard.up("x");
  await close(opened);
  await end(session);
});

browser_test("fingers steer at 360 pixels of width", async () => {
  const session = await serve(...kPair), opened = await open(session.address, { width: 360, height: 740, touch: true }), { page } = opened;
  // Nothing hangs over at the side; a bar to scroll down by may take a part of the width.
  assert.equal(await page.evaluate(() => document.documentElement.scrollWidth - document.documentElement.clientWidth), 0);
  const hands = await page.createCDPSession();
  const touch = async (type, id) => {
    const { x, y } = await page.$eval(id, (button) => {
      button.scrollIntoView();
      const { left, top, width, height } = button.getBoundingClientRect();
      return { x: left + width / 2, y: top + height / 2 };
    });
    await hands.send("Input.dispatchTouchEvent", { type, touchPoints: type === "touchEnd" ? [] : [{ x, y }] });
  };
  await page.tap("#pedal");
  await reads(page, "#live-readout", /fluoroscopy/);
  await touch("touchStart", "#push");
  await page.waitForFunction(() => Number(document.querySelector("#live-readout").textContent.match(/(-?\d+) mm/)?.[1]) >= 30, { timeout: 20000 });
  await touch("touchEnd", "#push");
  await rested_mm(page);
  await page.tap("#next-hub");
  await reads(page, "#live-readout", /^guidewire-035-j/);
  await page.tap("#pedal");
  await reads(page, "#live-readout", /held picture/);
  await close(opened);
  await end(session);
});

browser_test("of two tabs one steers, and the other when it has left", async () => {
  const session = await serve("--device-model", "cobra-5f"), first = await open(session.address);
  await first.page.waitForFunction(() => window.said.length > 0);
  assert.deepEqual(await c_arms_said(first.page), []); // who opens a page has not moved the C-arm
  await go_to(first.page, "lao=30&table=20");
  await first.page.waitForFunction(() => window.said.some(({ c_arm }) => c_arm));
  const second = await open(session.address);
  await reads(second.page, "#live-role", /^You watch; another browser steers; 2 browsers/);
  // Its tab is hidden now, where animation frames, for which waitForFunction waits, do not come.
  await first.page.evaluate((said) => new Promise((done) => setInterval(() => window.said.length > said + 2 && done(), 50)), await first.page.evaluate(() => window.said.length));
  const moves = await c_arms_said(first.page); // nor by somebody who watches
  assert.deepEqual(moves.map(({ lao_deg, table_mm }) => [lao_deg, table_mm]), [[30, 20]]);
  assert.ok(await second.page.$eval("#push", (button) => button.disabled));
  await second.page.focus("#stage");
  const readout = await second.page.$eval("#readout", (readout) => readout.textContent);
  await second.page.keyboard.press("ArrowRight"); // turns its own C-arm
  await second.page.waitForFunction((before) => document.querySelector("#readout").textContent !== before, {}, readout);
  assert.equal(await insertion_mm(second.page), 0);
  await close(first);
  await reads(second.page, "#live-role", /^You steer$/);
  await second.page.keyboard.down("ArrowUp");
  await second.page.waitForFunction(() => Number(document.querySelector("#live-readout").textContent.match(/(-?\d+) mm/)?.[1]) >= 10, { timeout: 20000 });
  await second.page.keyboard.up("ArrowUp");
  await close(second);
  await end(session);
});

browser_test("a page of another origin and another name are refused", async () => {
  const session = await serve("--device-model", "cobra-5f"), { address, port } = session;
  const elsewhere = create_http((_, answer) => answer.setHeader("Content-Type", "text/html").end("<title>elsewhere</title>"));
  await new Promise((done) => elsewhere.listen(0, "127.0.0.1", done));
  const page = await chromium().newPage();
  await page.goto(`http://127.0.0.1:${elsewhere.address().port}/`);
  const attempt = await page.evaluate((address) => new Promise((done) => {
    const socket = new WebSocket(address);
    socket.onopen = () => done("open");
    socket.onerror = () => done("refused");
  }), address.replace("http", "ws").replace("/?", "/live?"));
  assert.equal(attempt, "refused");
  assert.equal(await page.evaluate((address) => fetch(address).then(() => "read", () => "refused"), address), "refused");
  const rebound = await page.goto(address.replace(`127.0.0.1:${port}`, `rebound.example:${port}`));
  assert.equal(rebound.status(), 403);
  assert.equal((await page.goto(address.replace("127.0.0.1", "localhost"))).status(), 200);
  assert.equal((await page.goto(address.replace(/token=./, "token=x"))).status(), 403);
  await page.close();
  elsewhere.close();
  assert.match(session.log(), /was refused: a page of another origin may not connect/);
  await end(session);
});

test("Firefox steers too", { skip: !existsSync("/usr/bin/firefox-esr") && "there is no firefox-esr" }, async () => {
  const firefox = await puppeteer.launch({ browser: "firefox", executablePath: "/usr/bin/firefox-esr", headless: true, extraPrefsFirefox: { "webgl.force-enabled": true } });
  const session = await serve("--device-model", "cobra-5f");
  try {
    const opened = await open(session.address, { browser: firefox }), { page } = opened;
    await page.focus("#stage");
    await page.keyboard.down("ArrowUp");
    await page.waitForFunction(() => Number(document.querySelector("#live-readout").textContent.match(/(-?\d+) mm/)?.[1]) >= 10, { timeout: 20000 });
    await page.keyboard.up("ArrowUp");
    await close(opened);
  } finally {
    await firefox.close();
    await end(session);
  }
});

browser_test("a lost connection is said, and comes back", async () => {
  const sockets = new Set();
  let target = 0;
  const proxy = createServer((socket) => {
    const onward = connect(target, "127.0.0.1");
    for (const [a, b] of [[socket, onward], [onward, socket]]) {
      sockets.add(a);
      a.on("error", () => {}).on("close", () => b.destroy());
      a.pipe(b);
    }
  });
  await new Promise((done) => proxy.listen(0, "127.0.0.1", done));
  const { port } = proxy.address(), session = await serve("--device-model", "cobra-5f", "--web-host", `127.0.0.1:${port}`);
  target = session.port;
  const opened = await open(session.address.replace(`:${session.port}`, `:${port}`)), { page } = opened;
  await page.focus("#stage");
  await page.keyboard.down("x");
  await reads(page, "#live-readout", /fluoroscopy/);
  for (const socket of sockets) socket.destroy();
  await reads(page, "#note", /Connection lost; trying again/);
  await reads(page, "#live-role", /^You steer$/);
  await reads(page, "#live-readout", /held picture/); // the pedal is let go of
  await page.waitForFunction(() => document.querySelector("#note").hidden);
  await end(session);
  await reads(page, "#note", /Connection lost; trying again/);
  await close(opened);
  proxy.close();
});

/** Of the body in the picture, a phase a mode. */
const phases = (page) => page.evaluate(() => document.documentElement.dataset.phases.split(",").map(Number));

/** How many pixels of the traces have a colour, red, green and blue. */
const traced = (page, colour) => page.$eval("#live-traces", (canvas, colour) => {
  const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
  let count = 0;
  for (let i = 0; i < data.length; i += 4) if (data[i + 3] > 200 && colour.every((value, c) => Math.abs(data[i + c] - value) < 8)) ++count;
  return count;
}, colour);

browser_test("a body in motion is held, gated and sped up, and its traces are drawn", async (t) => {
  const session = await serve_map("moving.exr", "rest"), opened = await open(session.address), { page } = opened;
  await reads(page, "#live-role", /^You steer$/);
  assert.equal(await page.$eval("#body-buttons", (buttons) => buttons.innerText.replace(/\s+/g, " ").trim().startsWith("Hold breath Arrest heart Gate Motion")), true);
  await page.focus("#stage");
  await page.keyboard.down("x");
  await wait(1500);
  const first = await phases(page);
  const moved = first.map(() => false), limit = Date.now() + 10000; // two breaths: a breath rests at its end for a second and more
  for (; !moved.every((m) => m) && Date.now() < limit; await wait(100)) (await phases(page)).forEach((phase, m) => (moved[m] ||= phase !== first[m]));
  assert.ok(moved.every((m) => m), `${first} stayed: ${moved}`);
  const counts = async () => [await traced(page, [0x5a, 0xdc, 0x78]), await traced(page, [0x6e, 0xbe, 0xfa]), await traced(page, [0xff, 0xc4, 0x3c])];
  let drawn = await counts(); // ECG, breath and exposures, of which a few seconds draw as much
  for (const end = Date.now() + 10000; !(drawn[0] > 100 && drawn[1] > 50 && drawn[2] > 20); drawn = await counts()) {
    assert.ok(Date.now() < end, `${drawn} pixels of ECG, breath and exposures`);
    await wait(200);
  }
  await page.keyboard.press("b");
  await reads(page, "#live-readout", /breath held$/);
  await page.click("#body-holds button:nth-child(2)");
  await reads(page, "#live-readout", /breath held, heart arrested$/);
  await wait(300);
  const held = await phases(page);
  await wait(500);
  assert.deepEqual(await phases(page), held);
  assert.match(await page.$eval("#live-traces", (canvas) => canvas.getAttribute("aria-label")), /^breath, held; ECG, held; \d+ exposures/);
  if (process.env.XRAYCAST_SCREENSHOTS) await page.screenshot({ path: join(process.env.XRAYCAST_SCREENSHOTS, "live-body.png") });
  await page.keyboard.press("k");
  await page.keyboard.press("g");
  await reads(page, "#live-readout", /breath held, gated: heart at 75 %$/);
  await wait(300);
  const before = await exposures(page);
  await wait(3000);
  const gated = (await exposures(page)) - before;
  t.diagnostic(`${gated} exposures in 3 s of a gated heart; its phase is ${(await phases(page))[1]}`);
  assert.ok(gated >= 2 && gated <= 5, `${gated}`); // a beat of 0.86 s
  assert.ok(Math.abs((await phases(page))[1] - 0.75) < 0.03);
  await page.keyboard.press("g");
  await page.keyboard.press("b");
  await page.select("#body-speed", "2");
  await reads(page, "#live-readout", /motion 2×$/);
  await page.keyboard.up("x");
  await close(opened);
  assert.equal(await end(session), 143);
});

/** Of the upper half, over all channels, of a peak of 255. */
function psnr_dB(a, b) {
  assert.deepEqual([a.width, a.height], [b.width, b.height]);
  let sum = 0;
  const end = 2 * a.width * a.height;
  for (let i = 0; i < end; ++i) sum += i % 4 < 3 ? (a.data[i] - b.data[i]) ** 2 : 0;
  return 10 * Math.log10(255 ** 2 / Math.max(sum / (0.75 * end), 1e-9));
}

browser_test("the picture of a body in motion moves, and is that of render", async (t) => {
  for (const [breath, heart] of [[0, 0.4], [1, 0.7]]) {
    const session = await serve_map("moving.exr", "rest", "--phase", `breath=${breath}`, "--phase", `heart=${heart}`);
    const opened = await open(`${session.address}#ui=0&roadmap=0`, { width: 640, height: 480 }), { page } = opened;
    await page.waitForFunction(() => document.documentElement.dataset.motion === "loaded", { timeout: 60000 });
    await page.focus("#stage");
    await page.keyboard.down("x");
    await page.waitForFunction((from) => Number(document.documentElement.dataset.exposures) > from + 2, {}, await exposures(page));
    await page.keyboard.up("x");
    await wait(500);
    const shown = PNG.sync.read(Buffer.from(await page.screenshot({ type: "png" })));
    const dB = [[breath, heart], [1 - breath, heart]].map(([breath, heart]) => {
      run("render", file("moving.exr"), "-o", file("frame.png"), "--size", "640x480", "--phase", `breath=${breath}`, "--phase", `heart=${heart}`);
      return psnr_dB(shown, PNG.sync.read(readFileSync(file("frame.png")))); // without the instrument, which is below
    });
    t.diagnostic(`breath ${breath}: ${dB[0].toFixed(1)} dB, against the other end of the breath ${dB[1].toFixed(1)} dB`);
    assert.ok(dB[0] >= 50 && dB[1] < dB[0] - 10, `${dB}`); // as of an exported page
    await close(opened);
    await end(session);
  }
});

browser_test("a browser that does not read holds up nobody", async (t) => {
  const session = await serve(...kPair), opened = await open(session.address), { page } = opened, { search } = new URL(session.address);
  const deaf = connect(session.port, "127.0.0.1");
  deaf.write(`GET /live${search} HTTP/1.1\r\nHost: 127.0.0.1:${session.port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n`);
  deaf.pause();
  await reads(page, "#live-role", /2 browsers/);
  await page.focus("#stage");
  await page.keyboard.down("x");
  await page.keyboard.down("ArrowUp");
  const count = (name) => page.evaluate((name) => Number(document.documentElement.dataset[name]), name);
  await wait(2000);
  const from = Date.now(), [pictures, told] = [await count("pictures"), await count("exposures")];
  await wait(6000);
  const passed_s = (Date.now() - from) / 1000, per_s = ((await count("pictures")) - pictures) / passed_s;
  t.diagnostic(`${per_s.toFixed(1)} pictures/s are drawn, of ${(((await count("exposures")) - told) / passed_s).toFixed(1)} exposures/s`);
  assert.ok(per_s > 1); // as many as the machine draws
  await page.keyboard.up("x");
  deaf.destroy();
  await close(opened);
  await end(session);
});
