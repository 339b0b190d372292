// What `xraycast export` has put into the page: a header in JSON, and one deflated stream of numbers
// (viewer/xraycast/export/web_page.hpp).
import type { CArmPose, PoseLimits } from "./c_arm_pose";
import type { GreyWindow } from "./grey_window";
import { inflated } from "./inflated";
import { KeyRows, key_before, owner_of } from "./key_maps";
import type { ModeHeader } from "./motion_mode";
import { Lattice, LatticeHeader, lattice_of } from "./moving_lattice";
import { Numbers } from "./numbers";
import type { Vec3 } from "./vectors";
import type { Bounds, Cone } from "./view";

interface MapHeader {
  width: number;
  height: number;
  layers: number;
  radii_mm: number[];
  centre_mm: [number, number];
  top_mm: number;
  row_mm: number;
  field_mm: [Vec3, Vec3] | null;
  has_outline: boolean;
  bands: number[]; // the first row of each band of rows that share an outline
  bounds: Bounds;
  precision: "byte" | "half";
  ranges: [number, number][]; // of bytes: a layer's offset and scale
}

/** Of a body that moves. */
export interface MotionHeader {
  modes: ModeHeader[];
  rows: [base: number, first: number, count: number][]; // of each key map: see KeyRows
  drawn_ranges: [number, number][]; // of the bytes of each drawn layer: offset and scale
  lattice: LatticeHeader | null; // how vessels move; none: they do not
  held: Record<string, number>; // modes that are held at first, and their phases
  speed: number;
  gate: { mode: string; phase: number } | null;
}

interface MeshHeader {
  points: number;
  triangles: number;
  unit_mm: number; // of the coordinates
  ring: number; // points a ring, by which the next one is predicted; 0: none
}

interface Matter {
  is_closed: boolean; // its back faces are never seen
  mu_per_mm: number;
  colour: Vec3;
  tube_sides?: number; // of an instrument's tube: its points are a pole, rings of so many, and a pole; 0 or none: no such tube
}

/** A catheter has one part; a wire has two, its shaft and its tip, which is denser. */
export interface InstrumentHeader {
  name: string;
  radius_mm: number;
  /** Its tubing or core, and its markers, bands around the instrument. */
  parts: { mu_per_mm: number; colour: Vec3; inner_radius_mm: number }[]; // 0: a tube
  balloon_bar?: number; // what its balloon bears
  sheath?: { mm: number; rings: number }; // how far that of its stent is drawn back, and of how many rings that is
  coils?: number; // that its wire pushes, one after the other
}

/** Of what balloons and stents consist. */
export interface DeviceMatter {
  mu_per_mm: number;
  colour: Vec3;
  tube_sides: number;
}

interface RunInstrumentHeader extends InstrumentHeader {
  force_N: number[];
  torque_mNm: number[];
}

interface RunHeader {
  instruments: RunInstrumentHeader[]; // from the outermost on
  pictures: number;
  step_s: number;
  unit_mm: number;
  moves: boolean; // its time is that of the body's motion
}

interface LiveHeader {
  instruments: InstrumentHeader[];
  contrast: MeshHeader & Matter & Drums;
  matters: DeviceMatter[]; // of balloons and stents
  has_hub: boolean; // the page moves the hubs
  modes?: string[]; // of the body in motion, in order
  vessels: string[]; // branches of the tree, in words
}

/** Instruments that are steered. */
interface Choices {
  choices: InstrumentHeader[]; // that may be taken
  used: number[]; // of these at first, from the outermost on
}

export interface TargetMark {
  name: string;
  at_mm: Vec3;
  radius_mm: number;
}

export interface ExerciseHeader extends Choices {
  title: string;
  task: string;
  entry_mm: Vec3;
  targets: TargetMark[]; // in their order
}

/** Of a page that simulates by itself. */
interface TrainerHeader extends Choices {
  tree_numbers: number; // with which the setup begins, also that of each exercise
  pulses_per_s: number; // of the fluoroscope
  dose: number; // its level at first, of kDoses
  compression: number; // of its display at first
  exercises: ExerciseHeader[];
}

/** Of contrast agent: a mesh has so many points and triangles for each, one drum behind the other. */
interface Drums {
  drum_points: number;
  drum_triangles: number;
}

/** What the viewer's C-arm can do, and how it draws. */
interface ViewerHeader extends PoseLimits {
  presets: { name: string; lao_deg: number }[];
  road_map_colour: [number, number, number]; // 0 to 255
}

export interface Header {
  format: number;
  title: string;
  viewer: ViewerHeader;
  map: MapHeader;
  motion: MotionHeader | null; // none: the body stands still
  vessels: (MeshHeader & Matter) | null;
  catheters: (MeshHeader & Matter)[];
  run: RunHeader | null;
  live: LiveHeader | null;
  trainer: TrainerHeader | null;
  pose: CArmPose;
  cone: Cone | null;
  is_of_session: boolean; // its pose is one that a viewer saved
  look: "fluoro" | "surface";
  shows_vessels: boolean;
  shows_road_map: boolean;
  full_contrast: boolean;
  window: Pick<GreyWindow, "scale" | "dark" | "light"> | null; // none: automatic
  greys: Pick<GreyWindow, "gamma" | "inverted">; // under any window
  layer_weights: number[];
  parts: Record<string, [number, number]>; // first byte and their number, once inflated
}

export interface MapGeometry extends MapHeader {
  reaches_mm: Float32Array; // of every column of each band: where its rays end, as radii_mm have it
  scales: Float32Array; // of every column of each band: its outline's share of the largest radius
}

/** The key maps' own rows: K x count x W bytes of each. */
export interface KeyMapData {
  modes: ModeHeader[];
  rows: KeyRows[];
  bytes: Uint8Array[];
  drawn_ranges: [number, number][];
}

export interface Motion extends Omit<MotionHeader, "lattice" | "rows"> {
  keys: KeyMapData;
  lattice: Lattice | null;
}

export interface Mesh {
  points_mm: Float32Array; // x, y, z
  triangles: Uint32Array; // three corners, counter-clockwise from outside
  moves?: number; // how often the points were moved, in place
}

export interface Surface extends Matter {
  mesh: Mesh;
  weights?: Float32Array; // of mu_per_mm, one a point, the same at a triangle's corners; seen by X-rays alone
  clusters?: Surface; // of a surface that moves: the same with fewer points, which move with it
}

export interface RunInstrument extends RunInstrumentHeader {
  /** Of each part and picture: the control points of its curve, from the introducer's side to that of the tip. */
  shapes: Vec3[][][];
}

export interface Run extends RunHeader {
  instruments: RunInstrument[];
}

export interface Contrast extends Surface, Drums {}

export interface Live extends LiveHeader {
  contrast: MeshHeader & Contrast;
}

export interface Trainer extends TrainerHeader {
  setup: Float64Array; // which the simulation takes
  fluoroscope: Float64Array; // the same of the fluoroscope
  exercise: ExerciseHeader | null;
}

export interface SessionData {
  header: Header;
  map: MapGeometry;
  tau: Float32Array; // K x H x W; of a body that moves there are key maps instead
  motion: Motion | null;
  vessels: Surface | null;
  catheters: Surface[];
  run: Run | null;
  live: Live | null;
  trainer: Trainer | null;
}

/** What the values to the left, above, and above to the left predict: the median edge detector of JPEG-LS. */
function predicted(left: number, above: number, corner: number): number {
  if (corner >= Math.max(left, above)) return Math.min(left, above);
  if (corner <= Math.min(left, above)) return Math.max(left, above);
  return left + above - corner;
}

/** Undoes the prediction of a picture's values, in place. */
function unpredict(values: Uint8Array | Uint16Array, width: number, height: number): void {
  for (let j = 0, at = 0; j < height; ++j)
    for (let i = 0; i < width; ++i, ++at) {
      const left = i > 0 ? values[at - 1]! : j > 0 ? values[at - width]! : 0;
      const above = j > 0 ? values[at - width]! : left, corner = i > 0 && j > 0 ? values[at - width - 1]! : above;
      values[at] = values[at]! + predicted(left, above, corner);
    }
}

/** The 16-bit floats, by their bits. */
function half_floats(): Float32Array {
  const values = new Float32Array(1 << 16);
  for (let bits = 0; bits < values.length; ++bits) {
    const exponent = (bits >> 10) & 31, fraction = bits & 1023;
    const size = exponent === 0 ? fraction * 2 ** -24 : (1024 + fraction) * 2 ** (exponent - 25);
    values[bits] = bits & 0x8000 ? -size : size;
  }
  return values;
}

function tau_of(map: MapHeader, packed: Uint8Array): Float32Array {
  const area = map.width * map.height, tau = new Float32Array(map.layers * area);
  if (map.precision === "byte") {
    for (let k = 0; k < map.layers; ++k) {
      const layer = packed.slice(k * area, (k + 1) * area), [offset, scale] = map.ranges[k]!;
      unpredict(layer, map.width, map.height);
      for (let i = 0; i < area; ++i) tau[k * area + i] = offset + scale * layer[i]!;
    }
    return tau;
  }
  // All low bytes of a layer, then all high ones; differences have their sign in the lowest bit.
  const value_of = half_floats(), layer = new Uint16Array(area);
  for (let k = 0; k < map.layers; ++k) {
    const low = 2 * k * area, high = low + area;
    for (let i = 0; i < area; ++i) {
      const coded = packed[low + i]! | (packed[high + i]! << 8);
      layer[i] = coded & 1 ? ~(coded >> 1) : coded >> 1;
    }
    unpredict(layer, map.width, map.height);
    for (let i = 0; i < area; ++i) tau[k * area + i] = value_of[layer[i]!]!;
  }
  return tau;
}

/** The first key map is packed as a map that stands still; of the others there are differences from the key map before. */
function key_maps_of({ modes, rows: all, drawn_ranges }: MotionHeader, map: MapHeader, first: Uint8Array, packed: Uint8Array): KeyMapData {
  const { width, height, layers } = map, area = width * height, rows = all.map(([base, first, count]) => ({ base, first, count }));
  const bytes = [first.slice()];
  for (let k = 0; k < layers; ++k) unpredict(bytes[0]!.subarray(k * area, (k + 1) * area), width, height);
  for (let key = 1, from = 0; key < rows.length; ++key) {
    const { first, count } = rows[key]!, own = packed.slice(from, from + layers * count * width), before = key_before(modes, key);
    from += own.length;
    for (let row = first; row < first + count; ++row) {
      const owner = owner_of(rows, before, row), { first: its_first, count: its_count } = rows[owner]!, there = bytes[owner]!;
      for (let k = 0; k < layers; ++k) {
        const to = (k * count + row - first) * width, at = (k * its_count + row - its_first) * width;
        for (let i = 0; i < width; ++i) own[to + i] = own[to + i]! + there[at + i]!;
      }
    }
    bytes.push(own);
  }
  return { modes, rows, bytes, drawn_ranges };
}

function motion_of(header: MotionHeader, map: MapHeader, part: (name: string) => Uint8Array): Motion {
  return {
    ...header, keys: key_maps_of(header, map, part("layers"), part("keys")),
    lattice: header.lattice && lattice_of(header.lattice, header.modes, part("lattice_nodes"), part("lattice_ways")),
  };
}

function mesh_of(header: MeshHeader, points: Uint8Array, triangles: Uint8Array): Mesh {
  const steps = new Int32Array(3 * header.points), indices = new Uint32Array(3 * header.triangles);
  let numbers = new Numbers(points);
  const { ring } = header, at = (i: number) => (i >= 0 ? steps[i]! : 0);
  for (let axis = 0; axis < 3; ++axis)
    for (let i = axis; i < steps.length; i += 3)
      steps[i] = at(i - 3) + (ring > 0 ? at(i - 3 * ring) - at(i - 3 * ring - 3) : 0) + numbers.next();
  numbers = new Numbers(triangles);
  // A corner is predicted by that of the triangle before.
  for (let i = 0; i < indices.length; ++i) indices[i] = (i >= 3 ? indices[i - 3]! : 0) + numbers.next();
  return { points_mm: Float32Array.from(steps, (s) => s * header.unit_mm), triangles: indices };
}

/** Shapes are stored from the tip on, as differences from the same point of the picture before, or of the same picture. */
function shapes_of({ pictures, unit_mm }: RunHeader, bytes: Uint8Array): Vec3[][] {
  const numbers = new Numbers(bytes), shapes: Vec3[][] = [];
  let before: number[][] = [];
  for (let picture = 0; picture < pictures; ++picture) {
    const points: number[][] = [], count = numbers.next();
    for (let i = 0; i < count; ++i) {
      const from = before[i] ?? points[i - 1] ?? [0, 0, 0];
      points.push([0, 1, 2].map((axis) => from[axis]! + numbers.next()));
    }
    before = points;
    shapes.push([...points].reverse().map((p) => [p[0]! * unit_mm, p[1]! * unit_mm, p[2]! * unit_mm]));
  }
  return shapes;
}

/** With what the simulation of an exercise, or of none, takes. */
function trainer_of(header: TrainerHeader, part: (name: string) => Uint8Array, exercise: number): Trainer {
  const numbers = (name: string) => new Float64Array(part(name).slice().buffer), whole = numbers("trainer"), chosen = header.exercises[exercise - 1], fluoroscope = numbers("fluoroscope");
  if (!chosen) return { ...header, fluoroscope, setup: whole, exercise: null };
  const use = numbers(`exercise_${exercise - 1}`), setup = new Float64Array(header.tree_numbers + use.length);
  setup.set(whole.subarray(0, header.tree_numbers));
  setup.set(use, header.tree_numbers);
  return { ...header, choices: chosen.choices, used: chosen.used, fluoroscope, setup, exercise: chosen };
}

/** Where it does not simulate, a page that would plays its run. `exercise` is 1 for the first, 0 for none. `begin` is called before all
 * that takes long. */
export async function session_of(header: Header, base64: string, can_simulate: boolean, exercise = 0, begin: (trainer: Trainer) => void = () => {}): Promise<SessionData> {
  const bytes = await inflated(base64);
  const part = (name: string) => {
    const [first, count] = header.parts[name] ?? [0, 0];
    return bytes.subarray(first, first + count);
  };
  const floats = (name: string) => new Float32Array(part(name).slice().buffer);
  const simulates = header.trainer !== null && can_simulate, trainer = simulates ? trainer_of(header.trainer!, part, exercise) : null;
  if (trainer) begin(trainer);
  const map = { ...header.map, reaches_mm: floats("reaches"), scales: floats("scales") };
  const surface_of = <Kind extends MeshHeader & Matter>(of: Kind, name: string) =>
    ({ ...of, mesh: mesh_of(of, part(`${name}_points`), part(`${name}_triangles`)) });
  const run = simulates ? null : header.run;
  const live = header.trainer && !simulates ? null : header.live && trainer ? { ...header.live, instruments: trainer.used.map((choice) => trainer.choices[choice]!) } : header.live;
  const shapes_of_instrument = (instrument: RunInstrumentHeader, d: number): RunInstrument =>
    ({ ...instrument, shapes: instrument.parts.map((_, p) => shapes_of(run!, part(`shapes_${d}_${p}`))) });
  return {
    header, map, tau: header.motion ? new Float32Array(0) : tau_of(header.map, part("layers")),
    motion: header.motion && motion_of(header.motion, header.map, part), vessels: header.vessels && surface_of(header.vessels, "vessel"),
    catheters: header.catheters.map((catheter, i) => surface_of(catheter, `catheter_${i}`)),
    run: run && { ...run, instruments: run.instruments.map(shapes_of_instrument) },
    trainer,
    live: live && { ...live, contrast: surface_of(live.contrast, "contrast") },
  };
}
