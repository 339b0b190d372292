// The fluoroscope of a page without a server, in Node's WebAssembly, against the program's (fluoroscope_trace.cpp): the same rays
// through both. Program, that reference and the folder web/ are named by the environment: XRAYCAST_WEB_TEST, XRAYCAST_TRACE and
// XRAYCAST_WEB.
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { readFileSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { join, resolve } from "node:path";
import { after, before, test } from "node:test";
import { pathToFileURL } from "node:url";
import { inflateSync } from "node:zlib";
import { file, remove_folder, run } from "./web_folder.mjs";

const web = resolve(process.env.XRAYCAST_WEB);
const { buildSync } = createRequire(pathToFileURL(join(web, "package.json")))("esbuild");
const { outputFiles } = buildSync({ entryPoints: [join(web, "src/fluoroscope.ts")], bundle: true, write: false, format: "esm", target: "es2022" });
const { Fluoroscope } = await import(`data:text/javascript;base64,${Buffer.from(outputFiles[0].contents).toString("base64")}`);

const kSide = 256, kPixel_mm = 0.308, kTauOf20cm = 4, kMagnification = 1200 / 785;
let code, setup;

before(() => {
  run("phantom", "thorax", "--size", "64x64x80", "-o", file("thorax.nrrd"), "--truth", file("truth"));
  run("cast", file("thorax.nrrd"), "-o", file("map.exr"), "--layers", 2);
  run("export", file("map.exr"), "--vessels", file("truth"), "--live", "-o", file("page.html"));
  const html = readFileSync(file("page.html"), "utf8"), element = (id) => html.match(new RegExp(`id="${id}">([^<]*)<`))[1];
  const [first, count] = JSON.parse(element("session")).parts.fluoroscope, data = inflateSync(Buffer.from(element("data"), "base64"));
  code = inflateSync(Buffer.from(element("simulation"), "base64"));
  setup = new Float64Array(new Uint8Array(data.subarray(first, first + count)).buffer);
});

after(remove_folder);

/** A pulse of a square picture, or of another size. */
const pulse = (rays, { side = [kSide, kSide], pixel_mm = kPixel_mm, count = 1, pause_s = null, dose = 1, blades_mm = null, subtracts = false, shows_maximum = false, shows_road_map = false, mask_matching = null, phases = [], compression = 0 } = {}) => ({
  rays, settings: { dose, blades_mm, subtracts, shows_maximum, shows_road_map, mask_matching, compression },
  pulse: { view: { lao_rad: 0, cranial_rad: 0, cone: { source_axis_mm: 785, source_detector_mm: 1200 }, centre_mm: [0, 0, 0], width: side[0], height: side[1], pixel_mm }, count, pause_s, motion: { phases, speed: 1 } },
});
const flat = (tau, [width, height] = [kSide, kSide]) => new Float32Array(width * height).fill(tau);

/** Of a page: codes and greys of each pulse, and what it gave. */
async function page_pictures(pulses) {
  const fluoroscope = await Fluoroscope.of(code, setup);
  return pulses.map(({ rays, settings, pulse }) => {
    const { width, height } = pulse.view, from_below = new Float32Array(rays.length);
    for (let j = 0; j < height; ++j) from_below.set(rays.subarray(width * j, width * (j + 1)), width * (height - 1 - j));
    fluoroscope.set(settings);
    const from_ms = performance.now(), told = fluoroscope.expose(pulse, from_below, 1);
    return { told, ms: performance.now() - from_ms, codes: fluoroscope.codes(pulse.view), greys: fluoroscope.image(pulse.view) };
  });
}

/** The same of the program. */
function program_pictures(pulses) {
  const bytes = pulses.flatMap(({ rays, settings, pulse: { view: v, count, pause_s, motion } }) => {
    const numbers = Float64Array.of(v.lao_rad, v.cranial_rad, ...v.centre_mm, v.width, v.height, v.pixel_mm, v.cone.source_axis_mm, v.cone.source_detector_mm, count, pause_s ?? -1, settings.dose, ...(settings.blades_mm ?? [0, 0]).map((mm) => mm * kMagnification), Number(settings.subtracts), settings.compression,
      Number(settings.shows_maximum), Number(settings.shows_road_map), settings.mask_matching?.cycle_s ?? 0, motion.phases[0] ?? 0);
    return [new Uint8Array(numbers.buffer), new Uint8Array(rays.buffer)];
  });
  writeFileSync(file("pulses"), Buffer.concat(bytes));
  execFileSync(process.env.XRAYCAST_TRACE, [file("pulses"), file("trace")]);
  const trace = readFileSync(file("trace"));
  let at = 0;
  const take = (count, size) => new Uint8Array(trace.subarray(at, (at += count * size))).buffer;
  return pulses.map(({ rays }) => {
    const [kvp, mas, kerma_mGy_min, air_kerma_mGy, dap_Gycm2] = new Float64Array(take(5, 8));
    return { told: { kvp, mas, kerma_mGy_min, air_kerma_mGy, dap_Gycm2 }, codes: new Uint16Array(take(rays.length, 2)), greys: new Uint8Array(take(rays.length, 1)) };
  });
}

/** Pictures of both, which have given the same dose. */
async function both(pulses) {
  const page = await page_pictures(pulses), program = program_pictures(pulses);
  page.forEach(({ told }, k) => {
    // Beams are packed as floats, of 6e-8; the exposure control divides by what it measures of 1e4 pixels of codes.
    for (const [name, value] of Object.entries(program[k].told)) assert.ok(Math.abs(told[name] - value) <= 1e-5 * Math.abs(value), `pulse ${k}: ${name} ${told[name]} and ${value}`);
  });
  return { page, program };
}

const mean = (values) => values.reduce((sum, value) => sum + value, 0) / values.length;

function variance(values) {
  const middle = mean(values);
  return values.reduce((sum, value) => sum + (value - middle) ** 2, 0) / (values.length - 1);
}

/** How many differ, and by how much at most. */
function differences(a, b) {
  let count = 0, most = 0;
  for (let i = 0; i < a.length; ++i) {
    count += Number(a[i] !== b[i]);
    most = Math.max(most, Math.abs(a[i] - b[i]));
  }
  return { share: count / a.length, most };
}

/** Noise power along x in bands of frequencies up to Nyquist's, of the first rows of frequencies along y; Hann's window keeps bands apart. */
function noise_power(pictures) {
  const bands = new Float64Array(16), kRows = 4;
  for (const picture of pictures) {
    const middle = mean(picture);
    for (let ky = 1; ky <= kRows; ++ky) {
      const re = new Float64Array(kSide), im = new Float64Array(kSide);
      for (let j = 0; j < kSide; ++j) {
        const c = Math.cos((2 * Math.PI * ky * j) / kSide), s = Math.sin((2 * Math.PI * ky * j) / kSide);
        for (let i = 0; i < kSide; ++i) {
          const value = (picture[kSide * j + i] - middle) * (1 - Math.cos((2 * Math.PI * (i + 0.5)) / kSide));
          re[i] += c * value;
          im[i] += s * value;
        }
      }
      for (let kx = 1; kx <= 128; ++kx) {
        let a = 0, b = 0;
        for (let i = 0; i < kSide; ++i) {
          const c = Math.cos((2 * Math.PI * kx * i) / kSide), s = Math.sin((2 * Math.PI * kx * i) / kSide);
          a += re[i] * c - im[i] * s;
          b += re[i] * s + im[i] * c;
        }
        bands[(kx - 1) >> 3] += a * a + b * b;
      }
    }
  }
  return bands;
}

/** Of an edge's picture at `cycles` a pixel: its mean profile over rows, differentiated and transformed. */
function mtf(codes, cycles) {
  const kReach = 40, profile = Array.from({ length: 2 * kReach }, (_, i) => mean(Array.from({ length: 160 }, (_, j) => codes[kSide * (j + 48) + 128 - kReach + i])));
  let re = 0, im = 0, whole = 0;
  for (let i = 1; i < profile.length; ++i) {
    const step = profile[i] - profile[i - 1];
    re += step * Math.cos(2 * Math.PI * cycles * i);
    im += step * Math.sin(2 * Math.PI * cycles * i);
    whole += step;
  }
  return Math.hypot(re, im) / Math.abs(whole);
}

test("flat fields have the program's noise, in every code", async (t) => {
  for (const [water_cm, dose] of [[5, 1], [20, 0], [20, 1], [20, 2], [30, 1]]) {
    const rays = flat(0.2 * water_cm), { page, program } = await both(Array.from({ length: 6 }, () => pulse(rays, { dose })));
    const apart = page.map(({ codes }, k) => differences(codes, program[k].codes)), share = Math.max(...apart.map(({ share }) => share)), most = Math.max(...apart.map(({ most }) => most));
    const last = page.at(-1).codes, its = program.at(-1).codes;
    t.diagnostic(`${water_cm} cm, dose ${dose}: ${page.at(-1).told.kvp} kVp, mean ${mean(last).toFixed(2)} and ${mean(its).toFixed(2)}, variance ${variance(last).toFixed(2)} and ${variance(its).toFixed(2)}; ${(100 * share).toFixed(3)} % of the codes differ, by ${most} at most`);
    // Random numbers are the same. A sum that is rounded elsewhere, of 1e-7, changes the code of few pixels, by 1; a Poisson number
    // that is rounded elsewhere changes a pixel by a quantum, of some tens of codes.
    assert.ok(share < 0.01, `${share}`);
    assert.ok(Math.abs(mean(last) / mean(its) - 1) < 1e-4);
    assert.ok(Math.abs(variance(last) / variance(its) - 1) < 0.005);
  }
});

test("noise has the program's power at all frequencies", async (t) => {
  const { page, program } = await both(Array.from({ length: 8 }, () => pulse(flat(kTauOf20cm))));
  const ours = noise_power(page.map(({ codes }) => codes)), its = noise_power(program.map(({ codes }) => codes));
  const apart = Array.from(ours, (power, band) => power / its[band] - 1);
  t.diagnostic(`bands differ by ${Math.min(...apart).toExponential(1)} to ${Math.max(...apart).toExponential(1)}; the last has ${(ours[15] / ours[0]).toFixed(3)} of the first`);
  assert.ok(ours[15] < 0.5 * ours[0]); // light has spread
  for (const one of apart) assert.ok(Math.abs(one) < 0.005, `${one}`); // as the variance
});

test("an edge has the program's MTF", async (t) => {
  const rays = Float32Array.from(flat(kTauOf20cm), (tau, i) => (i % kSide < 128 ? tau : tau + 0.5));
  const { page, program } = await both(Array.from({ length: 4 }, () => pulse(rays, { dose: 2 })));
  const apart = [0.05, 0.1, 0.2, 0.3, 0.4].map((cycles) => [mtf(page.at(-1).codes, cycles), mtf(program.at(-1).codes, cycles)]);
  t.diagnostic(apart.map(([a, b]) => `${a.toFixed(3)} and ${b.toFixed(3)}`).join(", "));
  assert.ok(apart[2][0] < 0.9 && apart[4][0] < apart[2][0]);
  for (const [a, b] of apart) assert.ok(Math.abs(a - b) < 0.005, `${a} and ${b}`); // a quarter of the 0.02 that the filters are allowed
});

test("exposure, dose, lag and display follow the program's from pulse to pulse", async (t) => {
  const side = [192, 144], rays = [8, 20, 20, 20, 32, 32, 32, 32].map((water_cm) => flat(0.2 * water_cm, side)), pulses = rays.map((one, k) => pulse(one, { side, pixel_mm: 1.5, pause_s: k === 5 ? 2 : null }));
  const { page, program } = await both(pulses);
  const apart = page.map(({ greys }, k) => differences(greys, program[k].greys));
  t.diagnostic(`${page.map(({ told }) => told.kvp).join()} kVp; greys differ in ${apart.map(({ share }) => (100 * share).toFixed(2)).join()} %, by ${Math.max(...apart.map(({ most }) => most))} at most`);
  assert.ok(page[3].told.kvp > page[0].told.kvp && page[7].told.kvp > page[3].told.kvp);
  for (const { share } of apart) assert.ok(share < 0.02, `${share}`); // a code's difference beside the border of two greys
});

test("blades and subtraction are the program's", async () => {
  const rays = Float32Array.from(flat(kTauOf20cm), (tau, i) => tau + (i % kSide > 120 && i % kSide < 130 ? 0.2 : 0));
  const open = pulse(flat(kTauOf20cm), { dose: 2 }), blades = { dose: 2, blades_mm: [40, 30] };
  const { page } = await both([open, pulse(flat(kTauOf20cm), blades), pulse(flat(kTauOf20cm), blades)]);
  const [whole, shut] = [page[0], page[2]].map(({ told }, k) => told.dap_Gycm2 - (k === 0 ? 0 : page[1].told.dap_Gycm2));
  const kerma = [page[0].told.air_kerma_mGy, page[2].told.air_kerma_mGy - page[1].told.air_kerma_mGy];
  const share = (40 * 30) / ((kSide * kPixel_mm) / kMagnification) ** 2;
  assert.ok(Math.abs(shut / kerma[1] / (whole / kerma[0]) / share - 1) < 1e-3); // lines of which the area is summed up
  assert.ok(page[2].greys[0] < 5 && page[2].greys[kSide * 128 + 128] > 60);
  const mask = { dose: 2, subtracts: true }, angio = await both([...Array.from({ length: 4 }, () => pulse(flat(kTauOf20cm), mask)), ...Array.from({ length: 3 }, () => pulse(rays, mask))]);
  assert.ok(angio.page[2].told.is_masking && !angio.page[3].told.is_masking);
  const last = angio.page.at(-1).greys, row = (i) => mean(Array.from({ length: 100 }, (_, j) => last[kSide * (j + 80) + i]));
  assert.ok(row(125) < row(60) - 50, `${row(125)} and ${row(60)}`); // contrast agent is dark
  assert.ok(differences(last, angio.program.at(-1).greys).share < 0.02);
});

/** Rays of an upright vessel about a column, filled by so much. */
const with_vessel = (column, tau) => Float32Array.from(flat(kTauOf20cm), (body, i) => body + (Math.abs((i % kSide) - column) < 5 ? tau : 0));
const column_of = (greys, column) => mean(Array.from({ length: 100 }, (_, j) => greys[kSide * (j + 80) + column]));

test("maximum opacification and an angiogram's road map are the program's", async () => {
  const seen = { dose: 2, subtracts: true }, mask = Array.from({ length: 4 }, () => pulse(flat(kTauOf20cm), seen));
  const filled = [80, 125, 170].map((column) => pulse(with_vessel(column, 0.4), { ...seen, shows_maximum: true }));
  const live = { dose: 2, shows_road_map: true }, mapped = Array.from({ length: 3 }, () => pulse(flat(kTauOf20cm), live));
  const turned = pulse(flat(kTauOf20cm), { ...live, pixel_mm: 1.1 * kPixel_mm });
  const { page, program } = await both([...mask, ...filled, ...mapped, turned]);
  page.forEach(({ greys }, k) => assert.ok(differences(greys, program[k].greys).share < 0.02, `pulse ${k}`));
  const opacified = page[6].greys, behind = page[9];
  for (const column of [80, 125, 170]) {
    assert.ok(column_of(opacified, column) < column_of(opacified, 30) - 50); // all that was filled
    assert.ok(column_of(behind.greys, column) > column_of(behind.greys, 30) + 20); // bright behind the live picture
  }
  assert.ok(behind.told.has_angiogram && !behind.told.has_lost_road_map);
  assert.ok(page[10].told.has_lost_road_map && !page[10].told.has_angiogram); // another view has none
});

test("masks of a body that moves are those of its phases", async () => {
  const phases = Array.from({ length: 16 }, (_, k) => k / 15), edge = (phase) => 100 + Math.round(40 * Math.sin(2 * Math.PI * phase));
  const body = (phase) => Float32Array.from(flat(kTauOf20cm), (tau, i) => tau + (i % kSide > edge(phase) ? 1 : 0));
  const of = (mask_matching) => phases.concat(phases).map((phase) => pulse(body(phase), { dose: 2, subtracts: true, mask_matching, phases: [phase] }));
  const left_over = async (mask_matching) => {
    const { page, program } = await both(of(mask_matching)), last = page[20];
    assert.ok(differences(last.greys, program[20].greys).share < 0.02);
    assert.ok(!last.told.is_masking);
    const at_rest = column_of(last.greys, 20);
    return Array.from({ length: 100 }, (_, i) => 60 + i).filter((column) => Math.abs(column_of(last.greys, column) - at_rest) > 20).length;
  };
  const plain = await left_over(null), matched = await left_over({ mode: 0, wraps: true, cycle_s: 1 });
  assert.ok(plain > 20 && matched < 3, `the edge leaves ${plain} and ${matched} columns`); // it moved over 40
});

test("a compressed display is the program's", async () => {
  const rays = Float32Array.from(flat(kTauOf20cm), (tau, i) => tau + 2 * Math.sin((i % kSide) / 40) + (i % kSide > 120 && i % kSide < 130 ? 0.1 : 0));
  const { page, program } = await both([0, 0.6, 0.6].map((compression) => pulse(rays, { dose: 2, compression })));
  assert.ok(differences(page[2].greys, program[2].greys).share < 0.02);
  assert.ok(differences(page[2].greys, page[0].greys).share > 0.5);
});

test("pulses that were not drawn are counted", async () => {
  const pages = await page_pictures([pulse(flat(kTauOf20cm)), pulse(flat(kTauOf20cm)), pulse(flat(kTauOf20cm), { count: 3 })]);
  const [one, two, five] = pages.map(({ told }) => told.air_kerma_mGy);
  assert.ok(Math.abs((five - two) / (two - one) - 3) < 0.02); // mAs follow the signal by less
});

test("a picture of 640 x 480 takes a fraction of a pulse's time", async (t) => {
  const side = [640, 480], rays = flat(kTauOf20cm, side), pages = await page_pictures(Array.from({ length: 30 }, () => pulse(rays, { side, pixel_mm: 0.6 })));
  const times = pages.slice(1).map(({ ms }) => ms).sort((a, b) => a - b);
  t.diagnostic(`${pages[0].ms.toFixed(0)} ms the first, then ${times[0].toFixed(1)} to ${times.at(-1).toFixed(1)}, ${times[15].toFixed(1)} in the median`);
  assert.ok(times[0] < 66, `${times[0]}`); // of 15 a second, however busy the machine is
});
