// Modules of the exported page that need no browser: the address, the state, the run, the grey window and the C-arm.
// esbuild, which `npm ci` has put into web/node_modules, bundles each. The folder web/ is named by XRAYCAST_WEB.
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { existsSync, mkdtempSync, readFileSync, rmSync } from "node:fs";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";
import { test } from "node:test";
import { pathToFileURL } from "node:url";

const web = resolve(process.env.XRAYCAST_WEB);
const { buildSync } = createRequire(pathToFileURL(join(web, "package.json")))("esbuild");

async function module_of(name) {
  const { outputFiles } = buildSync({
    entryPoints: [join(web, "src", name)], bundle: true, write: false, format: "esm", target: "es2022",
    loader: { ".glsl": "text", ".frag": "text", ".vert": "text" },
  });
  return import(`data:text/javascript;base64,${Buffer.from(outputFiles[0].contents).toString("base64")}`);
}

const { exercise_of, hash_of, hash_with_exercise, state_of } = await module_of("address.ts");
const { BodyClock } = await module_of("body_clock.ts");
const { MotionMode, phase_weights } = await module_of("motion_mode.ts");
const { bands_at, key_before, owner_of, rounded, shares_at } = await module_of("key_maps.ts");
const { Lattice } = await module_of("moving_lattice.ts");
const { ShownPhases } = await module_of("motion_player.ts");
const { TraceLog } = await module_of("traces.ts");
const { Store, first_state } = await module_of("state.ts");
const { picture_at, shown_time_s, surfaces_of } = await module_of("instrument_shape.ts");
const { step_s } = await module_of("run_player.ts");
const { view_of } = await module_of("c_arm_pose.ts");
const { pixel_on_detector_mm, shown_at, source_mm } = await module_of("view.ts");
const { Notes } = await module_of("notes.ts");
const { Sampler } = await module_of("samples.ts");
const { rectified_view } = await module_of("rectified.ts");
const { drawn_bands } = await module_of("layers.ts");
const { clustered, tube } = await module_of("mesh.ts");
const { absorbed_by, covered_by } = await module_of("absorption.ts");
const { widening_of } = await module_of("thin_tube.ts");
const { message_of } = await module_of("live_message.ts");
const { filled } = await module_of("contrast.ts");
const { held_of } = await module_of("steering.ts");
const { LastLoads } = await module_of("live.ts");
const { Recording } = await module_of("recording.ts");
const { held_on } = await module_of("gamepad.ts");
const { LastTraces, breath_of } = await module_of("live_body.ts");

const kRun = { pictures: 151, step_s: 1 / 15, instruments: [] };
const kBounds = { centre_mm: [0, 0, 0], radius_mm: 200, half_height_mm: 360, finest_mm: 6.24 };
const session = ({ header = {}, ...more } = {}) => ({
  header: {
    pose: { lao_deg: 0, cranial_deg: 0, zoom: 1, table_mm: 0, left_mm: 0, back_mm: 0 }, look: "fluoro", window: null, greys: { gamma: 1, inverted: false }, layer_weights: [],
    shows_vessels: false, shows_road_map: false, viewer: { presets: [], least_zoom: 0.25, most_zoom: 40, most_tilt_deg: 50 }, ...header,
  },
  map: { layers: 4, bounds: kBounds }, vessels: null, catheters: [], run: null, live: null, motion: null, ...more,
});
const opened = (data, hash = "") => new Store(state_of(hash, first_state(data)), first_state(data), data);
const again = (state, data) => opened(data, hash_of(state, first_state(data))).state;

test("a link to each picture of a run opens that picture", () => {
  const data = session({ run: kRun });
  for (let k = 0; k < kRun.pictures; ++k)
    for (const later_s of [0, 0.5 * kRun.step_s]) {
      const state = { ...opened(data).state, time_s: shown_time_s(kRun, k * kRun.step_s + later_s) };
      assert.equal(picture_at(kRun, again(state, data).time_s), k);
    }
});

test("a run opens with most of its instruments in the body, wherever that is", () => {
  const reach = (mm) => [0, 1, 2, 3].map((i) => [0, 0, (i * mm) / 3]), shapes = (reaches) => [reaches.map(reach)];
  const run = { pictures: 4, step_s: 0.5, instruments: [{ shapes: shapes([20, 90, 90, 20]) }, { shapes: shapes([20, 20, 300, 50]) }] };
  const data = session({ run }), { state } = opened(data);
  assert.equal(state.time_s, 1); // neither the first picture nor the last, in which they are withdrawn
  assert.match(hash_of({ ...state, time_s: 0 }, state), /&t=0$/);
  assert.equal(again({ ...state, time_s: 0 }, data).time_s, 0);
});

test("a link says what differs from the export, also where that is a usual value", () => {
  const window = { scale: 2, dark: 0.1, light: 0.9 }, greys = { gamma: 1.5, inverted: false };
  const data = session({ header: { pose: { lao_deg: 30, cranial_deg: 10, zoom: 1.5, table_mm: 20, left_mm: 30, back_mm: -10 }, window, greys } });
  const { state } = opened(data);
  const changed = { ...state, pose: { lao_deg: 0, cranial_deg: 0, zoom: 1, table_mm: 0, left_mm: 0, back_mm: 0 }, window: null };
  assert.deepEqual(again(changed, data), changed);
  assert.equal(hash_of(state, first_state(data)), "#lao=30");
  assert.deepEqual(again(state, data), state);
});

test("greys are those of the session under its window, an automatic one and that of a link", () => {
  const greys = { gamma: 1.5, inverted: true };
  for (const window of [null, { scale: 2, dark: 0.1, light: 0.9 }])
    for (const hash of ["", "#window=3,0,1", "#window=auto"]) {
      const { state } = opened(session({ header: { window, greys } }), hash);
      assert.deepEqual([state.gamma, state.inverted], [1.5, true]);
      if (state.window) assert.deepEqual([state.window.gamma, state.window.inverted], [1.5, true]);
    }
});

test("a narrow grey window survives its link", () => {
  const data = session(), window = { scale: 3.1e-5, dark: 0.12345, light: 0.9, gamma: 1, inverted: false };
  assert.deepEqual(again({ ...opened(data).state, window }, data).window, window);
});

test("what an address cannot ask for is passed over", () => {
  const data = session();
  for (const text of ["Infinity,0,1", "1,0.5,0.5", "1,0,2", "NaN,0,1", "1,0", "1,0,1,1", "-1,0,1"]) assert.equal(opened(data, `#window=${text}`).state.window, null, text);
  assert.ok(Math.abs(opened(data, "#lao=1.79e308").state.pose.lao_deg) <= 180);
  assert.deepEqual(opened(data, "#hide=3,1,1,99999,0,-1,x").state.hidden_layers, [0, 2]);
  assert.equal(opened(data, "#zoom=1e9&t=7").state.pose.zoom, 40);
  assert.equal(opened(data, "#t=7").state.time_s, 0);
});

test("nothing is shown that the session does not have, whoever asks", () => {
  const store = opened(session(), "#look=surface&vessels=1&roadmap=1");
  store.update({ look: "surface", shows_vessels: true, shows_road_map: true });
  const { look, shows_vessels, shows_road_map } = store.state;
  assert.deepEqual([look, shows_vessels, shows_road_map], ["fluoro", false, false]);
});

test("what stays within the limits stays the same object", () => {
  const store = opened(session()), { pose } = store.state;
  store.update({ time_s: 0, inverted: true });
  assert.equal(store.state.pose, pose);
});

test("at zoom 1 the height fits in whole voxels, and tilting does not zoom but where the whole body is asked for", () => {
  const pose = { lao_deg: 0, cranial_deg: 0, zoom: 1, table_mm: 0, left_mm: 0, back_mm: 0 }, pixel_mm = (pose, fit) => view_of(pose, null, kBounds, 480, 360, fit).pixel_mm;
  // 720 mm are 116 voxels of 6.24 mm.
  assert.ok(Math.abs(pixel_mm(pose, "untilted") - (116 * 6.24) / 360) < 1e-12);
  assert.equal(pixel_mm({ ...pose, cranial_deg: 30 }, "untilted"), pixel_mm(pose, "untilted"));
  assert.ok(pixel_mm({ ...pose, cranial_deg: 30 }, "tilted") > pixel_mm(pose, "tilted"));
});

test("a run that was hidden goes on where it was", () => {
  assert.ok(Math.abs(step_s(1000, 1040, 2) - 0.08) < 1e-12);
  assert.ok(step_s(1000, 61000, 1) <= 0.25);
  assert.equal(step_s(1000, 990, 1), 0);
});

test("what is said for a moment does not end what holds", async () => {
  const said = [], notes = new Notes((words) => said.push(words));
  notes.state("lost");
  notes.tell("copied", 5);
  await new Promise((done) => setTimeout(done, 30));
  notes.tell("copied", 5);
  notes.state("");
  await new Promise((done) => setTimeout(done, 30));
  assert.deepEqual(said, ["lost", "copied", "lost", "copied", ""]);
});

test("vessels without contrast agent are outlined all the same", () => {
  // A tetrahedron, its faces counter-clockwise from outside.
  const mesh = { points_mm: Float32Array.of(0, 0, 0, 80, 0, 0, 0, 80, 0, 0, 0, 80), triangles: Uint32Array.of(0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3) };
  const view = view_of({ lao_deg: 10, cranial_deg: 0, zoom: 1, table_mm: 0, left_mm: 0, back_mm: 0 }, null, kBounds, 64, 48, "untilted");
  const surface = (mu_per_mm) => ({ mesh, mu_per_mm, is_closed: true }), count = ({ tau }) => tau.filter((tau) => tau > 0).length;
  assert.equal(count(absorbed_by([surface(0)], view)), 0);
  assert.ok(count(covered_by(surface(0), view)) > 5);
});

/** A box as a drum of contrast agent would be: points and triangles, from `low` to `high` along y. */
function box(low, high) {
  const points = [0, 1, 2, 3, 4, 5, 6, 7].flatMap((i) => [i & 1 ? 40 : -40, i & 2 ? high : low, i & 4 ? 40 : -40]);
  const faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
  return { points, triangles: faces.flatMap(([a, b, c, d]) => [a, b, c, a, c, d]) };
}

/** Drums one behind the other along the beam from the front, as a page has them. */
function drums(...ranges) {
  const boxes = ranges.map(([low, high]) => box(low, high));
  return {
    drum_points: 8, drum_triangles: 12, is_closed: true, mu_per_mm: 0.001, colour: [1, 1, 1],
    mesh: { points_mm: Float32Array.from(boxes.flatMap(({ points }) => points)), triangles: Uint32Array.from(boxes.flatMap(({ triangles }, i) => triangles.map((corner) => corner + 8 * i))) },
  };
}

test("drums absorb by what they hold, and the larger where they overlap", () => {
  const whole = drums([-20, 0], [-10, 10], [50, 60]), view = view_of({ lao_deg: 0, cranial_deg: 0, zoom: 1, table_mm: 0, left_mm: 0, back_mm: 0 }, null, kBounds, 64, 48, "untilted");
  const most = (surfaces) => Math.max(0, ...(absorbed_by(surfaces, view)?.tau ?? []));
  const near = (found, wanted) => assert.ok(Math.abs(found - wanted) < 1e-4, `${found}, not ${wanted}`); // of 32-bit floats
  near(most([filled(whole, [{ drum: 2, mg_ml: 100, ends_mm: [0, 0] }])]), 0.1 * 10);
  near(most([filled(whole, [{ drum: 0, mg_ml: 100, ends_mm: [0, 0] }, { drum: 1, mg_ml: 300, ends_mm: [0, 0] }])]), 0.1 * 10 + 0.3 * 20);
  near(most([filled(whole, [{ drum: 0, mg_ml: 200, ends_mm: [0, 0] }, { drum: 1, mg_ml: 200, ends_mm: [0, 0] }])]), 0.2 * 30);
  assert.equal(filled(whole, []), null);
  assert.equal(filled(whole, [{ drum: 3, mg_ml: 100, ends_mm: [0, 0] }]), null); // of no such drum
});

const kWire_mm = 0.18; // the radius of a wire of 0.014 inch

/** An instrument in the plane of the axis, 10 degrees off the vertical and so far aside. */
function rod(radius_mm, aside_mm, mu_per_mm = 1) {
  const along = [Math.sin(0.175), 0, Math.cos(0.175)], line = Array.from({ length: 61 }, (_, i) => [aside_mm + 10 * (i - 30) * along[0], 0, 10 * (i - 30) * along[2]]);
  return { mesh: tube(line, radius_mm, 8), tube_sides: 8, is_closed: true, mu_per_mm, colour: [1, 1, 1] };
}

/** The optical depths of rows, each summed across, in the middle of a picture. */
function sums_across(surfaces, view) {
  const { y, width, height, tau } = absorbed_by(surfaces, view), middle = Math.floor(view.height / 2) - y;
  assert.ok(middle >= 20 && middle + 20 < height);
  return Array.from({ length: 40 }, (_, j) => tau.subarray((middle - 20 + j) * width, (middle - 19 + j) * width).reduce((sum, tau) => sum + tau, 0));
}

test("a wire thinner than a pixel is without gaps and absorbs what it holds, also in blood", () => {
  for (const cone of [null, { source_axis_mm: 780, source_detector_mm: 1200 }])
    for (const pixel_mm of [0.3, 0.5, 1, 2]) {
      const view = { lao_rad: 0, cranial_rad: 0, cone, centre_mm: [0, 0, 0], width: 161, height: 161, pixel_mm: pixel_mm * (cone ? 1200 / 780 : 1) };
      const blood = drums([-20, 20]);
      let added = 0, rows = 0;
      for (let shift = 0; shift < 8; ++shift) {
        const wire = rod(kWire_mm, (shift / 8) * pixel_mm), closed = (Math.PI * kWire_mm ** 2) / pixel_mm / Math.cos(0.175);
        sums_across([wire], view).forEach((sum) => assert.ok(sum > 0.7 * closed, `${pixel_mm} mm: ${sum / closed}`));
        if (pixel_mm > 0.5) continue; // where the box of blood is not all that is seen
        const with_wire = sums_across([blood, wire], view);
        sums_across([blood], view).forEach((sum, j) => {
          added += (with_wire[j] - sum) / (closed * (1 - blood.mu_per_mm));
          ++rows;
        });
      }
      // The phases of rows are not all alike, a cone's rays are longer by up to 1 %.
      if (rows > 0) assert.ok(Math.abs(added / rows - 1) < 0.05, `${pixel_mm} mm: ${added / rows}`);
    }
});

test("an instrument of several pixels' width is drawn as it is", () => {
  const view = { lao_rad: 0, cranial_rad: 0, cone: null, centre_mm: [0, 0, 0], width: 161, height: 161, pixel_mm: 0.5 }, catheter = rod(1, 0.1);
  assert.deepEqual(absorbed_by([catheter], view), absorbed_by([{ ...catheter, mesh: { ...catheter.mesh }, tube_sides: 0 }], view));
  assert.equal(widening_of(catheter, view).factor, 1);
  assert.ok(widening_of(rod(kWire_mm, 0), view).factor > 1);
});

test("a marker absorbs by the chord through its wall", () => {
  const radius_mm = 0.45, inner_radius_mm = 0.4, body = 0.5, metal = 8;
  const line = (low, high) => Array.from({ length: 4 }, (_, i) => [0, 0, low + ((high - low) * i) / 3]);
  const instrument = { name: "a", radius_mm, parts: [{ mu_per_mm: body, colour: [1, 1, 1], inner_radius_mm: 0 }, { mu_per_mm: metal, colour: [1, 1, 1], inner_radius_mm }] };
  const surfaces = surfaces_of(instrument, [line(-30, 30), line(-0.5, 0.5)]);
  const view = { lao_rad: 0, cranial_rad: 0, cone: null, centre_mm: [0, 0, 0], width: 161, height: 41, pixel_mm: 0.02 };
  const { y, width, x, tau } = absorbed_by(surfaces, view), row = tau.subarray((20 - y) * width, (21 - y) * width);
  const chord = (radius_mm, x_mm) => 2 * Math.sqrt(Math.max(0, radius_mm ** 2 - x_mm ** 2));
  const closed = (x_mm) => metal * (chord(radius_mm, x_mm) - chord(inner_radius_mm, x_mm)) + body * chord(inner_radius_mm, x_mm);
  // Sixteen flat sides: the wall is thinner by up to a fiftieth, of the cross-section there is 0.974.
  assert.ok(Math.abs(row[80 - x] / closed(0) - 1) < 0.04, `${row[80 - x]}, not ${closed(0)}`);
  const sum = row.reduce((sum, tau) => sum + tau, 0), wanted = Array.from({ length: 161 }, (_, i) => closed(0.02 * (i - 80))).reduce((sum, tau) => sum + tau, 0);
  assert.ok(Math.abs(sum / wanted - 0.974) < 0.01, `${sum / wanted}`);
  assert.deepEqual(surfaces_of(instrument, [line(-30, 30), []]).length, 1); // it has yet to enter
});

/** As viewer/xraycast/serving/browser_message.cpp writes it. */
function live_bytes(has_body = true) {
  const view = new DataView(new ArrayBuffer(4 + 4 * 6 + 4 * (4 + 2 + 4 + 9 + 1 + 1 + 6) + 4 * (1 + 3 + 8) + 4 * 5 + 4 * (has_body ? 1 + 2 + 2 * 6 + 2 + 3 : 1)));
  [5, 5, 0, 1].forEach((byte, i) => view.setUint8(i, byte));
  let at = 4;
  const whole = (x) => view.setUint32((at += 4) - 4, x, true), real = (x) => view.setFloat32((at += 4) - 4, x, true);
  whole(9);
  [1.5, 2, 3, 110, 0.25, 100, 45, 0.25, -2].forEach(real);
  whole(21);
  [12.5, 8, 6.5, 0].forEach(real);
  [3, 4, 1].forEach(whole);
  [10, 300, 298, 100, 120, 80, 93].forEach(real);
  [1, 2].forEach(whole);
  [1, 2, 3, 4, 5, 6].forEach(real);
  [1, 1].forEach(whole); // devices
  real(0);
  whole(2);
  [1, 2, 3, 0.5, 4, 5, 6, 0.25].forEach(real);
  [1, 7].forEach(whole);
  [350, 2, 2.5].forEach(real);
  whole(has_body ? 2 : 0);
  if (!has_body) return view.buffer;
  [20, 2].forEach(real);
  for (const [marks, phase, gate, values] of [[1, 0.25, 0, [0.5, 0.75]], [2, 0.5, 0.75, [0.125, 1]]]) {
    whole(marks);
    [phase, gate].forEach(real);
    whole(2);
    values.forEach(real);
  }
  whole(1);
  [19.5, 1, 2, 3].forEach(real);
  return view.buffer;
}

test("a live message is read as it is written", () => {
  assert.deepEqual(message_of(live_bytes()), {
    exposes: true, injects: false, is_valve_locked: true, has_outlet: false, held_hub: 0, exposures: 9, time_s: 1.5, fluoroscopy_s: 2, injected_ml: 3, aortic_mmHg: 110, packing: 0.25,
    instruments: [{ insertion_mm: 100, rotation_deg: 45, force_N: 0.25, torque_mNm: -2, tip_branch: 21, tip_along_mm: 12.5, inflation_bar: 8, balloon_mm: 6.5, release_mm: 0, free_rings: 3, detach: 4,
      coil: { can_be_detached: true, is_outside: false, loop_mm: 10, length_mm: 300, laid_mm: 298 }, pressure: { now_mmHg: 100, systolic_mmHg: 120, diastolic_mmHg: 80, mean_mmHg: 93 }, parts_mm: [[[1, 2, 3], [4, 5, 6]]] }],
    devices: [{ matter: 1, inner_radius_mm: 0, points: [[1, 2, 3, 0.5], [4, 5, 6, 0.25]] }],
    filled: [{ drum: 7, mg_ml: 350, ends_mm: [2, 2.5], moved_mm: [1, 2, 3] }],
    body: {
      time_s: 20, speed: 2, exposures_s: [19.5],
      modes: [{ is_held: true, gate: null, phase: 0.25, trace: [0.5, 0.75] }, { is_held: false, gate: 0.75, phase: 0.5, trace: [0.125, 1] }],
    },
  });
  const still = message_of(live_bytes(false));
  assert.deepEqual([still.body, still.filled], [null, [{ drum: 7, mg_ml: 350, ends_mm: [2, 2.5] }]]);
  for (let size = 0; size < live_bytes().byteLength; ++size) assert.throws(() => message_of(live_bytes().slice(0, size)), `${size}`);
  const huge = live_bytes();
  new DataView(huge).setUint32(104, 0xffffffff, true); // parts
  assert.throws(() => message_of(huge), /too short/);
  const other = live_bytes();
  new DataView(other).setUint8(0, 1);
  assert.throws(() => message_of(other), /another version/);
});

test("traces are of the last six seconds, and of nothing that is missing", () => {
  const traces = new LastTraces(["breath", "heart"]), values = (k) => Array.from({ length: 10 }, (_, i) => (10 * k + i) / 10000);
  const told = (k, more = {}) => ({ time_s: 0.05 * (k + 1), speed: 1, exposures_s: [0.05 * k], modes: [{ is_held: k > 100, gate: null, phase: 0, trace: values(k) }, { is_held: false, gate: null, phase: 0, trace: values(k) }], ...more });
  for (let k = 0; k < 200; ++k) traces.add(told(k));
  const { modes, exposures_s, length_s } = traces.shown;
  assert.deepEqual([modes[0].name, modes[0].is_held, modes[0].values.length, modes[0].values[1199], length_s], ["breath", true, 1200, 0.1999, 6]);
  assert.ok(exposures_s.length > 115 && exposures_s.every((age_s) => age_s >= 0 && age_s <= 6.001));
  traces.add(told(300)); // what came between was lost
  assert.equal(traces.shown.modes[1].values.length, 10);
});

test("a breath hold holds the breath", () => {
  assert.deepEqual([["cough", "breath", "heart"], ["heart", "cough"], ["heart"]].map(breath_of), ["breath", "cough", undefined]);
});

test("a line is at the phase of a gate, which another mode does not have", () => {
  const log = new TraceLog(2);
  log.add(() => [0.5, 0.25], 0);
  const { modes, exposures_s } = log.shown((m) => ({ name: "ab"[m], is_held: m === 1, gate: m === 0 ? 0.75 : null }));
  assert.deepEqual([modes[0].gate, modes[1].gate, modes[1].is_held, modes[0].values.at(-1), exposures_s], [0.75, null, true, 0.5, []]);
});

test("a run is recorded as a script", () => {
  const recording = new Recording(2), at = (time_s, ...poses) => ({ time_s, instruments: poses.map(([insertion_mm, rotation_deg]) => ({ insertion_mm, rotation_deg, inflation_bar: 0, release_mm: 0, detach: 0 })) });
  for (const [k, mm] of [0, 0, 0, 0, 2, 3, 3, 3, 3, 5].entries()) recording.add(at(7 + 0.1 * k, [mm, -1], [0, 0]));
  recording.add(at(7.2, [4, 0], [0, 0])); // late
  const [names, ...rows] = recording.csv().trim().split("\n");
  assert.equal(names, "time_s,insertion_mm,rotation_deg,insertion_2_mm,rotation_2_deg");
  assert.deepEqual(rows.map((row) => row.split(",").slice(0, 2).map(Number)), [[0, 0], [0.3, 0], [0.4, 2], [0.5, 3], [0.8, 3], [0.9, 5]]);
  recording.clear();
  assert.equal(recording.csv(), "time_s,insertion_mm,rotation_deg,insertion_2_mm,rotation_2_deg\n");
});

test("balloons, sheaths and coils are recorded where they are used", () => {
  const recording = new Recording(2), hub = (insertion_mm, inflation_bar, release_mm, detach = 0) => ({ insertion_mm, rotation_deg: 0, inflation_bar, release_mm, detach });
  recording.add({ time_s: 1, instruments: [hub(5, 0, 0), hub(9, 0, 0)] });
  recording.add({ time_s: 2, instruments: [hub(5, 0, 0), hub(9, 6.5, 0)] });
  assert.equal(recording.csv(), "time_s,insertion_mm,rotation_deg,insertion_2_mm,rotation_2_deg,inflation_2_bar\n0.0000,5,0,9,0,0\n1.0000,5,0,9,0,6.5\n");
  recording.clear();
  recording.add({ time_s: 3, instruments: [hub(5, 0, 0), hub(9, 0, 0, 2)] });
  recording.add({ time_s: 4, instruments: [hub(5, 0, 0), hub(9, 0, 0, 3)] });
  assert.equal(recording.csv(), "time_s,insertion_mm,rotation_deg,insertion_2_mm,rotation_2_deg,detach_2\n0.0000,5,0,9,0,0\n1.0000,5,0,9,0,1\n");
});

test("steps are recorded to the last digit", () => {
  const recording = new Recording(1);
  recording.add_steps(Float64Array.of(0.001, 0, 0, 0, 0, 0, 0.002, 0, 0, 0, 0, 0, 0.003, 0, 0, 0, 0, 0));
  recording.add_steps(Float64Array.of(0.004, 1 / 3, Math.PI / 7, 0, 0, 0, 0.005, 2 / 3, Math.PI / 7, 0, 0, 0));
  assert.equal(recording.csv(), `time_s,insertion_mm,rotation_deg\n0.0000,0,0\n0.0020,0,0\n0.0030,${1 / 3},${((Math.PI / 7) * 180) / Math.PI}\n0.0040,${2 / 3},${((Math.PI / 7) * 180) / Math.PI}\n`);
});

test("the address names an exercise", () => {
  assert.deepEqual(["", "#exercise=2", "#exercise=0", "#exercise=9", "#exercise=x"].map((hash) => exercise_of(hash, 3)), [1, 2, 0, 1, 1]);
  assert.equal(exercise_of("", 0), 0);
  assert.equal(hash_with_exercise("#lao=30&exercise=1", 3), "#lao=30&exercise=3");
});

test("a point is shown where the detector has its pixel", () => {
  const view = { lao_rad: 0.5, cranial_rad: -0.2, cone: { source_axis_mm: 700, source_detector_mm: 1100 }, centre_mm: [10, 20, 30], width: 400, height: 300, pixel_mm: 0.7 };
  const pixel = pixel_on_detector_mm(view, 99.5, 49.5), source = source_mm(view, view.cone);
  for (const share of [0.5, 0.9, 1]) {
    const { x, y } = shown_at(view, source.map((from, i) => from + share * (pixel[i] - from)));
    assert.ok(Math.hypot(x - 100, y - 50) < 1e-9, `${x} ${y}`);
  }
});

test("a gamepad's stick has a dead zone", () => {
  const pad = (x, y, ...pressed) => held_on({ axes: [x, y], buttons: Array.from({ length: 4 }, (_, b) => ({ pressed: pressed.includes(b) })) });
  assert.deepEqual(pad(0.1, -0.15), { push: 0, turn: 0, pedal: false, inject: false });
  assert.deepEqual(pad(1, -1, 0), { push: 1, turn: 1, pedal: true, inject: false });
  assert.deepEqual(pad(0, 1, 1), { push: -1, turn: 0, pedal: false, inject: true });
});

test("contrast agent moves with the body", () => {
  const mesh = { points_mm: Float32Array.from({ length: 12 }, (_, i) => i), triangles: new Uint32Array([0, 1, 0, 2, 3, 2]) };
  const whole = { mesh, drum_points: 2, drum_triangles: 1, mu_per_mm: 1, colour: [1, 1, 1] };
  const at = (moved_mm) => [...filled(whole, [{ drum: 1, mg_ml: 5, ends_mm: [0, 0], ...(moved_mm && { moved_mm }) }]).mesh.points_mm];
  assert.deepEqual(at(), [6, 7, 8, 9, 10, 11]);
  assert.deepEqual(at([1, 2, -3]), [7, 9, 5, 10, 12, 8]);
});

test("opposite holds cancel", () => {
  assert.deepEqual(held_of(new Set(["push", "left", "slow"])), { push: 1, turn: -1, slow: true, pedal: false, inject: false });
  assert.deepEqual(held_of(new Set(["push", "pull", "pedal", "inject"])), { push: 0, turn: 0, slow: false, pedal: true, inject: true });
});

test("loads are kept for ten seconds, and not over a new run", () => {
  const loads = new LastLoads(["a", "b"]), instruments = (force_N) => [{ force_N, torque_mNm: 0 }, { force_N: -force_N, torque_mNm: 1 }];
  for (let i = 0; i <= 300; ++i) loads.add({ time_s: i / 20, instruments: instruments(i) });
  loads.add({ time_s: 15, instruments: instruments(1000) }); // told again
  const { instrument, force_N, torque_mNm, now, length_s } = loads.of(1);
  assert.deepEqual([instrument, force_N.length, force_N[0], force_N[now], torque_mNm[now]], ["b", 240, -100, -300, 1]);
  assert.ok(Math.abs(length_s - 10) < 1e-9);
  loads.add({ time_s: 0.1, instruments: instruments(1) });
  assert.deepEqual(loads.of(0).force_N, [1]);
  // Charts have even times, whenever messages came: half of the time is half of the samples.
  for (const time_s of [0.2, 0.3, 0.4, 1.1, 2.1]) loads.add({ time_s, instruments: instruments(time_s), aortic_mmHg: 100 });
  const even = loads.of(0).force_N;
  assert.ok(Math.abs(even.filter((force) => force > 1.1).length - 120) <= 1, `${even.filter((force) => force > 1.1).length}`);
});

test("clusters of a closed mesh are closed, fewer, and of nearly its volume", () => {
  const line = Array.from({ length: 200 }, (_, i) => [10 * Math.sin(i / 40), 0, i / 2]), mesh = tube(line, 6, 24);
  const volume = ({ points_mm: p, triangles }) => {
    let sum = 0;
    for (let t = 0; t < triangles.length; t += 3) {
      const [a, b, c] = [0, 1, 2].map((k) => p.slice(3 * triangles[t + k], 3 * triangles[t + k] + 3));
      sum += (a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0])) / 6;
    }
    return sum;
  };
  const few = clustered(mesh, 1.5), edges = new Map();
  for (let i = 0; i < few.triangles.length; ++i) {
    const from = few.triangles[i], to = few.triangles[i % 3 === 2 ? i - 2 : i + 1], key = from < to ? `${from} ${to}` : `${to} ${from}`;
    edges.set(key, (edges.get(key) ?? 0) + (from < to ? 1 : -1));
  }
  assert.ok([...edges.values()].every((count) => count === 0)); // as often one way as the other
  assert.ok(few.triangles.length < 0.5 * mesh.triangles.length);
  // A chord of a cluster lies within the tube by 1.5 mm squared / 8 / 6 mm at most, of 6 mm: 1.6 % of the area, twice with its height.
  assert.ok(Math.abs(volume(few) / volume(mesh) - 1) < 0.04, `${volume(few) / volume(mesh)}`);
});

test("what the program and the page both say is the same", () => {
  const text = (path) => readFileSync(join(web, path), "utf8");
  const number = (path, pattern) => Number(text(path).match(pattern)?.[1]);
  const angles = number("../viewer/xraycast/export/export_request.hpp", /kMostWebAngles = (\d+)/);
  assert.equal(number("src/samples.ts", /kLayer = (\d+)/), angles + 1); // columns, of which the last repeats the first
  assert.match(text("src/shaders/columns.glsl"), new RegExp(`place & ${angles}, layer = place >> ${Math.log2(angles + 1)};`));
  const viewer = "../viewer/xraycast/scene/catheter_surface.cpp", image = "../host/xraycast/base/image.cpp";
  for (const [there, in_viewer, here, in_page] of [
    ...["kBins", "kRise", "kLeast", "kMost", "kStays", "kEdges"].map((name) => {
      const said = new RegExp(`\\b${name} = ([\\d.]+)`);
      return ["../host/xraycast/base/metal_depth.cpp", said, "grey_window.ts", said];
    }),
    [viewer, /kBandRingsPerNode = (\d+)/, "instrument_shape.ts", /kBandRingsPerPoint = (\d+)/],
    ["../viewer/xraycast/scene/catheter_surface.hpp", /kBandSides = (\d+)/, "instrument_shape.ts", /kBandSides = (\d+)/],
    [viewer, /kRingsPerNode = (\d+)/, "instrument_shape.ts", /kRingsPerPoint = (\d+)/], [viewer, /kSides = (\d+)/, "instrument_shape.ts", /kSides = (\d+)/],
    ["../viewer/xraycast/scene/thin_tube.hpp", /kLeastRadius_pixels = ([\d.]+)/, "thin_tube.ts", /kLeastRadius_pixels = ([\d.]+)/],
    [image, /kHeadroom = ([\d.]+)/, "grey_window.ts", /kHeadroom = ([\d.]+)/], [image, /kMatter = ([\d.]+)/, "grey_window.ts", /kMatter = ([\d.]+)/],
  ]) {
    const wanted = number(there, in_viewer);
    assert.ok(wanted > 0, `${there} ${in_viewer}`);
    assert.equal(number(`src/${here}`, in_page), wanted, `${in_page}`);
  }
});

/** A map of two layers, whose samples tell their layers apart. */
/** A map of as many bands of rows as `bands` has first rows; the outline of each but the first is narrower. */
function small_map(bands = [0]) {
  const of_bands = (first, step) => Float32Array.from({ length: 8 * bands.length }, (_, i) => first - step * Math.floor(i / 8));
  const width = 8, height = 6, map = {
    width, height, layers: 2, radii_mm: [0, 40, 60], centre_mm: [0, 0], top_mm: 50, row_mm: 20, field_mm: null, has_outline: false,
    bounds: { centre_mm: [0, 0, 0], radius_mm: 60, half_height_mm: 60, finest_mm: 1 },
    bands, reaches_mm: of_bands(60, 5), scales: of_bands(1, 0.25),
  };
  const tau = Float32Array.from({ length: 2 * width * height }, (_, i) => 0.1 + 0.01 * ((7 * i) % 13));
  return { map, tau };
}

/** The optical depths of a row of columns of the map, summed as the shaders sum them. */
function sums(map, values, weights) {
  const sampler = new Sampler(map), columns = map.width + 1, run = 4 * Math.ceil(map.height / 4);
  sampler.set_weights(weights);
  const view = view_of({ lao_deg: 20, cranial_deg: 0, zoom: 1, table_mm: 0, left_mm: 0, back_mm: 0 }, null, map.bounds, 32, 32, "untilted");
  const r = rectified_view(view, map, 1), { columns: table, samples } = sampler.samples_of(r, 3);
  const texel = (layer, column) => values[(layer * columns + column) * run] ?? 0;
  return Array.from({ length: r.columns }, (_, i) => {
    let sum = 0;
    for (let at = table[4 * i]; at < table[4 * i] + table[4 * i + 1]; ++at) {
      const [place, weight, right, next] = samples.subarray(8 * at, 8 * at + 4), column = place % 2048, layer = Math.floor(place / 2048);
      const mixed = (k) => (1 - right) * texel(k, column) + right * texel(k, column + 1);
      sum += weight * ((1 - next) * mixed(layer) + (next > 0 ? next * mixed(layer + 1) : 0));
    }
    return sum;
  });
}

test("weights of layers act on samples as they would on the map", () => {
  const { map, tau } = small_map(), [{ values }] = drawn_bands(map, tau, 2), layer = values.length / 4;
  for (const weights of [[1, 0], [0, 1], [0.5, 2], [0, 0]]) {
    const weighted = values.map((value, i) => weights[Math.floor(i / layer / 2)] * value);
    const wanted = sums(map, weighted, []), found = sums(map, values, weights);
    // Samples are stored as 32-bit floats.
    wanted.forEach((tau, i) => assert.ok(Math.abs(found[i] - tau) < 1e-5, `${weights}: ${found[i]}, not ${tau}`));
    assert.equal(Math.max(...wanted) > 0.01, weights.some((weight) => weight > 0));
  }
});

test("a map is the same in bands of any height", () => {
  for (const bands of [[0], [0, 3]]) {
    const { map, tau } = small_map(bands), columns = map.width + 1, [whole] = drawn_bands(map, tau, 2);
    for (const { first_quad, quads, values } of drawn_bands(map, tau, 1))
      for (let line = 0; line < 4 * columns; ++line)
        assert.deepEqual(values.slice(4 * quads * line, 4 * quads * (line + 1)), whole.values.slice(8 * line + 4 * first_quad, 8 * line + 4 * (first_quad + quads)));
  }
});

test("rows are solved over the outline of their own band", () => {
  const { map, tau } = small_map([0, 3]), [{ values: both }] = drawn_bands(map, tau, 2);
  const of_band = (band) => ({ ...map, bands: [0], reaches_mm: map.reaches_mm.slice(8 * band, 8 * band + 8), scales: map.scales.slice(8 * band, 8 * band + 8) });
  const [above, below] = [0, 1].map((band) => drawn_bands(of_band(band), tau, 2).next().value.values);
  for (let line = 0; line < both.length / 8; ++line) // a column of a layer, of 6 rows and 2 that fill its quads
    for (let row = 0; row < 6; ++row) assert.equal(both[8 * line + row], (row < 3 ? above : below)[8 * line + row]);
  assert.notDeepEqual(above, below);
});

const kClocks = JSON.parse(readFileSync(new URL("body_clock.json", import.meta.url), "utf8")).clocks;
const near = (found, wanted, where) => assert.ok(Math.abs(found - wanted) < 1e-9, `${where}: ${found}, not ${wanted}`); // of doubles, in another order

test("the body's clock has the values of the program's", () => {
  for (const { modes, start_s, steps } of kClocks) {
    const clock = new BodyClock(modes.map((mode) => new MotionMode(mode)), start_s);
    for (const step of steps) {
      const where = JSON.stringify(step);
      if ("advance" in step) clock.advance(step.advance);
      if ("speed" in step) clock.speed = step.speed;
      if ("hold" in step) clock.hold(step.hold, step.phase);
      if ("release" in step) clock.release(step.release);
      near(clock.time_s, step.time_s, where);
      for (const [found, wanted] of [[clock.phases(), step.phases], [clock.traces_at(clock.time_s), step.traces], [clock.phases_at(clock.time_s - 0.9), step.phases_before]])
        wanted.forEach((phase, m) => near(found[m], phase, where));
      for (const [m, phase, at_s] of step.next) {
        const found_s = clock.next_instant(m, phase, clock.time_s + 0.1);
        if (at_s === null) assert.equal(found_s, null, where);
        else near(found_s, at_s, where);
      }
    }
  }
});

test("a mode that never has a phase is not held at it", () => {
  const clock = new BodyClock(kClocks[1].modes.map((mode) => new MotionMode(mode)));
  assert.equal(clock.hold(0, 0.95), false);
  assert.equal(clock.is_held(0), false);
});

test("through a gate one phase alone is seen, without a gate all are", () => {
  const new_clock = () => new BodyClock(kClocks[1].modes.map((mode) => new MotionMode(mode))), clock = new_clock(), shown = new ShownPhases(clock), seen = new Set();
  for (let i = 0; i < 300; ++i) {
    const [, heart] = shown.advance(1 / 30, { m: 1, phase: 0.75 });
    if (clock.time_s > 0.8) assert.ok(Math.abs(heart - 0.75) < 1e-9, `${heart} at ${clock.time_s}`);
    seen.add(heart);
  }
  assert.ok(seen.size >= 2);
  const free = new ShownPhases(new_clock()), wanted = new_clock();
  for (let i = 0; i < 50; ++i) {
    wanted.advance(0.05);
    assert.deepEqual(free.advance(0.05, null), wanted.phases());
  }
});

const kModes = [{ name: "breath", wraps: false, phases: [0, 0.25, 1] }, { name: "heart", wraps: true, phases: [0, 0.5] }];

test("shares of key maps are those of the program, and jump nowhere", () => {
  let before = new Map();
  for (let i = 0; i <= 4000; ++i) {
    const breath = Math.min(1, i / 3000), heart = (i / 1000) % 1, shares = shares_at(kModes, [breath, heart]), at = (key) => [kModes[0].phases[Math.floor(key / 2)], kModes[1].phases[key % 2]];
    const sum = (of) => shares.reduce((all, { key, weight }) => all + weight * of(key), 0);
    near(sum(() => 1), 1, `${i}`);
    near(sum((key) => at(key)[0]), breath, `${i}`);
    near(2 * sum((key) => at(key)[1]), heart <= 0.5 ? 2 * heart : 2 - 2 * heart, `${i}`);
    const now = new Map(rounded(shares).map(({ key, weight }) => [key, weight]));
    assert.equal([...now.values()].reduce((a, b) => a + b), 256);
    // In a step of a 500th of a half beat, and rounded twice.
    if (i > 0) for (const key of new Set([...now.keys(), ...before.keys()])) assert.ok(Math.abs((now.get(key) ?? 0) - (before.get(key) ?? 0)) <= 3, `${i}`);
    before = now;
  }
});

test("bands take rows from the key maps that have them", () => {
  const rows = [[-1, 0, 24], [0, 8, 8], [0, 4, 16], [2, 8, 8], [0, 0, 24], [4, 8, 8]].map(([base, first, count]) => ({ base, first, count }));
  assert.equal(owner_of(rows, 3, 9), 3);
  assert.equal(owner_of(rows, 3, 5), 2);
  assert.equal(owner_of(rows, 3, 1), 0);
  assert.deepEqual([1, 2, 3, 5].map((key) => key_before(kModes, key)), [0, 0, 2, 4]);
  const bands = bands_at(kModes, rows, 24, [0.125, 0.25]);
  assert.deepEqual(bands.map(({ first, end }) => [first, end]), [[0, 4], [4, 8], [8, 16], [16, 20], [20, 24]]);
  assert.deepEqual(bands[0].shares, [{ key: 0, weight: 256 }]);
  assert.deepEqual(bands[1].shares, [{ key: 0, weight: 128 }, { key: 2, weight: 128 }]);
  assert.deepEqual(bands[2].shares, [0, 1, 2, 3].map((key) => ({ key, weight: 64 })));
});

test("splines go through their keys, and on without a jump", () => {
  const phases = [0, 0.2, 0.7], values = [1, 5, -2], at = (phase) => phase_weights(phases, true, phase).reduce((sum, weight, k) => sum + weight * values[k], 0);
  phases.forEach((phase, k) => near(at(phase), values[k], `${phase}`));
  near(at(1 - 1e-12), at(0), "the end");
});

test("a lattice moves points by the nodes about them", () => {
  // Two nodes a side; at the second key of one mode node n goes by n along x, in halves of a millimetre.
  const header = { origin_mm: [0, 0, 0], spacing_mm: 8, size: [2, 2, 2], nodes: 8, unit_mm: 0.5, phases: [[0, 1]] };
  const ways = new Int16Array(48);
  for (let n = 0; n < 8; ++n) ways[24 + n] = n;
  const lattice = new Lattice(header, [{ name: "breath", wraps: false, phases: [0, 1] }], new Map(Array.from({ length: 8 }, (_, i) => [i, i])), ways);
  const points = Float32Array.of(0, 0, 0, 8, 8, 8, 4, 2, 6), moved = new Float32Array(9);
  lattice.move(points, lattice.places_of(points), lattice.displacement_mm([0.5]), moved);
  // Half of: 0; 7 halves; 0.5 + 2 * 0.25 + 4 * 0.75 halves.
  assert.deepEqual([...moved], [0, 0, 0, 8 + 1.75, 8, 8, 4 + 1, 2, 6]);
});

test("traces are kept for six seconds, and those of another time are told anew", () => {
  const log = new TraceLog(1), traces_at = (time_s) => [time_s];
  log.add(traces_at, 0);
  assert.ok(log.traces[0][0] < -5.9); // what led up to it
  for (let time_s = 0; time_s < 20; time_s += 0.033) log.add(traces_at, time_s);
  assert.ok(Math.abs(log.traces[0].length - 1201) <= 1 && Math.abs(log.traces[0].at(-1) - 20) < 0.05);
  log.add(traces_at, 3);
  assert.ok(Math.abs(log.traces[0].at(-1) - 3) < 0.01 && log.traces[0][0] < -2.9);
});

test("an address names the instant of a body that moves, and a link says it", () => {
  const data = session({ motion: { modes: kModes.map((mode) => ({ ...mode, period_s: 1 })), held: {}, speed: 1 } }), first = first_state(data), names = ["breath", "heart"];
  const state = state_of("#phase=heart:0.8", first, names);
  assert.deepEqual([state.phases, state.is_paused], [[0, 0.8], true]);
  assert.match(hash_of({ ...state, phases: [0.12344, 0.8] }, first, names), /&phase=breath:0.1234,heart:0.8$/);
  for (const text of ["", "phase=", "phase=lung:1", "phase=heart:2", "phase=heart:x"]) assert.equal(state_of(`#${text}`, first, names).is_paused, false, text);
});

test("the body of a run has the phases of the picture that is shown", () => {
  const modes = [{ name: "breath", wraps: false, period_s: 4, phases: [0, 1] }, { name: "heart", wraps: true, period_s: 1, phases: [0, 0.5] }];
  const data = session({ run: { ...kRun, moves: true }, motion: { modes, held: { breath: 0.25 }, speed: 1 } }), store = opened(data);
  store.update({ time_s: 2.5 * kRun.step_s });
  assert.equal(store.state.phases[0], 0.25);
  near(store.state.phases[1], 2 * kRun.step_s, "heart");
});

test("the committed simulation is what its sources make", { skip: !existsSync("/usr/bin/emcc") && "there is no emscripten" }, () => {
  const folder = mkdtempSync(join(tmpdir(), "xraycast-simulation-"));
  try {
    execFileSync(join(web, "native/build.sh"), [join(folder, "simulation.txt"), join(folder, "objects")], { stdio: "ignore" });
    assert.ok(readFileSync(join(folder, "simulation.txt")).equals(readFileSync(join(web, "simulation.txt"))), "run ./dev page");
  } finally {
    rmSync(folder, { recursive: true });
  }
});
