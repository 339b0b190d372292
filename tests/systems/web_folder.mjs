// What tests of web pages have in common: a folder for their files, and the program that makes these, which the environment names:
// XRAYCAST_WEB_TEST.
import { execFileSync } from "node:child_process";
import { mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { require_of_web } from "./chromium.mjs";

export const { PNG } = require_of_web("pngjs");
export const program = process.env.XRAYCAST_WEB_TEST;

export const folder = mkdtempSync(join(tmpdir(), "xraycast-web-"));
export const file = (name) => join(folder, name);
export const remove_folder = () => rmSync(folder, { recursive: true });

/** Runs the program; what it prints. */
export const run = (...words) => execFileSync(program, words.map(String), { encoding: "utf8", stdio: ["ignore", "pipe", "ignore"] });

export const wait = (ms) => new Promise((done) => setTimeout(done, ms));
