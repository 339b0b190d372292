// PAGE POSES TRACE: steps the simulation of an exported page along poses, doubles of insertion in mm, rotation in rad, pressure in bar,
// sheath in mm and coils to be detached of each hub a step, and writes of each step and instrument tip in mm, force in N and torque in N m. Prints the mean time of a step in ms. The
// folder web/ is named by the environment: XRAYCAST_WEB.
import { readFileSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { join, resolve } from "node:path";
import { pathToFileURL } from "node:url";
import { inflateSync } from "node:zlib";

const web = resolve(process.env.XRAYCAST_WEB), [page, poses_file, trace_file] = process.argv.slice(2);
const { buildSync } = createRequire(pathToFileURL(join(web, "package.json")))("esbuild");
const { outputFiles } = buildSync({ entryPoints: [join(web, "src/simulation.ts")], bundle: true, write: false, format: "esm", target: "es2022" });
const { Simulation, kPoseNumbers } = await import(`data:text/javascript;base64,${Buffer.from(outputFiles[0].contents).toString("base64")}`);

const html = readFileSync(page, "utf8"), element = (id) => html.match(new RegExp(`id="${id}">([^<]*)<`))[1];
const header = JSON.parse(element("session")), packed = (id) => inflateSync(Buffer.from(element(id), "base64"));
const doubles = (bytes) => new Float64Array(new Uint8Array(bytes).buffer);
const [first, count] = header.parts.trainer, instruments = header.trainer.used.length;
const simulation = await Simulation.of(packed("simulation"), doubles(packed("data").subarray(first, first + count)));
const poses = doubles(readFileSync(poses_file)), steps = poses.length / (kPoseNumbers * instruments), trace = new Float64Array(5 * instruments * steps);
const from_ms = performance.now();
for (let k = 0; k < steps; ++k) trace.set(simulation.follow(poses.slice(kPoseNumbers * instruments * k, kPoseNumbers * instruments * (k + 1))), 5 * instruments * k);
console.log((performance.now() - from_ms) / steps);
writeFileSync(trace_file, new Uint8Array(trace.buffer));
