// Debian's Chromium on a display of its own, driven by puppeteer-core, which `npm ci` has put into web/node_modules. The
// folder web/ is named by the environment: XRAYCAST_WEB.
import { spawn } from "node:child_process";
import { once } from "node:events";
import { createRequire } from "node:module";
import { join, resolve } from "node:path";
import { test } from "node:test";
import { pathToFileURL } from "node:url";

export const require_of_web = createRequire(pathToFileURL(join(resolve(process.env.XRAYCAST_WEB), "package.json")));
export const puppeteer = require_of_web("puppeteer-core");

// Longer than every wait of a test: a call that takes as long is answered no more.
const kMaxCall_ms = 90000;

let screen, flags, browser;

/** Starts a screen and, on it, the Chromium that the tests share. */
export async function start_chromium(...its_flags) {
  flags = its_flags;
  screen = spawn("Xvfb", ["-displayfd", "3", "-screen", "0", "1280x1024x24", "-nolisten", "tcp"], { stdio: ["ignore", "ignore", "ignore", "pipe"] });
  const ended = once(screen, "exit").then(() => Promise.reject(new Error("Xvfb did not start")));
  const [number] = await Promise.race([once(screen.stdio[3], "data"), ended]);
  ended.catch(() => {}); // it ends with the tests
  process.env.DISPLAY = `:${String(number).trim()}`;
  browser = await launch_chromium(...flags);
}

/** A Chromium that has crashed may never end: its handler of crashes was seen to hold it for good. */
export async function end_chromium() {
  const closed = browser?.close().catch(() => {});
  const too_late = new Promise((done) => setTimeout(done, 10000, "hangs").unref());
  if ((await Promise.race([closed, too_late])) === "hangs") kill_chromium();
  screen?.kill();
}

/** With its children: it is the leader of their group. */
const kill_chromium = () => process.kill(-browser.process().pid, "SIGKILL");

/** The Chromium that the tests share. It draws by Mesa, by the processor. */
export const chromium = () => browser;

/** Another one. */
export const launch_chromium = (...its_flags) =>
  puppeteer.launch({ executablePath: "/usr/bin/chromium", headless: false, defaultViewport: null, protocolTimeout: kMaxCall_ms, args: ["--no-sandbox", "--disable-dev-shm-usage", ...its_flags] });

export const kMesa = ["--use-gl=angle", "--use-angle=gl", "--ignore-gpu-blocklist"];

/** Whether Chromium still opens a page and takes a picture of it. */
function answers() {
  const picture = browser.newPage().then(async (page) => {
    await page.screenshot();
    await page.close();
    return true;
  });
  const too_late = new Promise((done) => setTimeout(done, 30000, false).unref());
  return Promise.race([picture.catch(() => false), too_late]);
}

/**
 * A test that runs once more, in a fresh Chromium, where Chromium hangs: drawing by the processor, it has been seen to stop for
 * good while a picture was taken, and then answers no call, of no test.
 */
export function browser_test(name, body) {
  test(name, async (t) => {
    try {
      await body(t);
    } catch (error) {
      if (await answers()) throw error;
      t.diagnostic(`Chromium hung, and was started anew: ${error.message}`);
      kill_chromium();
      browser = await launch_chromium(...flags);
      await body(t);
    }
  });
}
