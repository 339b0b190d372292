// What the server tells of a live session, once a frame (viewer/xraycast/trainer/browser_message.hpp).
import type { Vec3 } from "./vectors";

/** Now, and over the last heartbeat. */
export interface PressureReading {
  now_mmHg: number;
  systolic_mmHg: number;
  diastolic_mmHg: number;
  mean_mmHg: number;
}

export interface LiveInstrument {
  insertion_mm: number;
  rotation_deg: number;
  force_N: number;
  torque_mNm: number;
  tip_branch: number; // of the vessel tree
  tip_along_mm: number;
  inflation_bar: number; // at the hub, for its balloon
  balloon_mm: number; // its diameter; 0 without a balloon
  release_mm: number; // how far its stent's sheath is drawn back
  free_rings: number; // of that stent
  detach: number; // coils that were to be detached so far
  coil: LiveCoil; // on its wire
  pressure: PressureReading; // of the blood at its tip
  /** At the last exposure: the control points of each part's curve. */
  parts_mm: Vec3[][];
}

export interface LiveCoil {
  can_be_detached: boolean; // all of it lies in a sac
  is_outside: boolean; // and not before a sac
  loop_mm: number;
  length_mm: number; // 0: there is none
  laid_mm: number; // of it, in the sac
}

export interface LiveMessage {
  exposes: boolean;
  injects: boolean;
  is_valve_locked: boolean;
  has_outlet: boolean; // a lumen is free for contrast agent
  held_hub: number;
  exposures: number; // so far: the picture changes with it
  time_s: number;
  fluoroscopy_s: number;
  injected_ml: number;
  aortic_mmHg: number;
  packing: number; // density of the coils in the sac that is packed most densely
  instruments: LiveInstrument[]; // from the outermost on
  devices: DeviceTube[]; // at the last exposure: balloons and stents
  filled: FilledDrum[]; // with contrast agent
  body: LiveBody | null; // in motion
}

/** A part of a balloon or stent. */
export interface DeviceTube {
  matter: number;
  inner_radius_mm: number; // of a band; 0: a tube
  points: [...at: Vec3, radius_mm: number][]; // none: it is not to be seen
}

export interface FilledDrum {
  drum: number;
  mg_ml: number;
  ends_mm: [number, number]; // the radii of its two ends, which balloons and stents widen
  moved_mm?: Vec3; // by a body in motion
}

/** A mode of the body, and what is new of its trace. */
export interface LiveMode {
  is_held: boolean;
  gate: number | null; // the phase that exposures wait for
  phase: number; // at the last exposure
  trace: number[]; // since the last message, kTraceStep_s apart up to time_s
}

export interface LiveBody {
  time_s: number;
  speed: number;
  modes: LiveMode[]; // in the motion's order
  exposures_s: number[]; // since the last message
}

export const kTraceStep_s = 0.005;

const kFormat = 5, kIsHeld = 1, kIsGate = 2, kCanBeDetached = 1, kIsOutside = 2;

/** Throws where the message is of another format, or too short. */
export function message_of(bytes: ArrayBuffer): LiveMessage {
  const view = new DataView(bytes);
  let at = 0;
  const byte = () => view.getUint8(at++);
  const whole = () => view.getUint32((at += 4) - 4, true), real = () => view.getFloat32((at += 4) - 4, true);
  const list = <Item>(item: () => Item): Item[] => Array.from({ length: limited(whole(), bytes) }, item);
  if (byte() !== kFormat) throw new Error("the server is of another version; open its page again");
  const flags = byte(), held_hub = byte(), instruments = byte();
  const point = (): Vec3 => [real(), real(), real()];
  const coil = (): LiveCoil => {
    const marks = whole();
    return { can_be_detached: (marks & kCanBeDetached) !== 0, is_outside: (marks & kIsOutside) !== 0, loop_mm: real(), length_mm: real(), laid_mm: real() };
  };
  const mode = (): LiveMode => {
    const marks = whole(), phase = real(), gate = real();
    return { is_held: (marks & kIsHeld) !== 0, gate: (marks & kIsGate) !== 0 ? gate : null, phase, trace: list(real) };
  };
  const body = (filled: FilledDrum[]): LiveBody | null => {
    const modes = limited(whole(), bytes);
    if (modes === 0) return null;
    const told = { time_s: real(), speed: real(), modes: Array.from({ length: modes }, mode), exposures_s: list(real) };
    for (const drum of filled) drum.moved_mm = point();
    return told;
  };
  const message = {
    exposes: (flags & 1) !== 0, injects: (flags & 2) !== 0, is_valve_locked: (flags & 4) !== 0, has_outlet: (flags & 8) !== 0, held_hub,
    exposures: whole(), time_s: real(), fluoroscopy_s: real(), injected_ml: real(), aortic_mmHg: real(), packing: real(),
    instruments: Array.from({ length: instruments }, () => ({
      insertion_mm: real(), rotation_deg: real(), force_N: real(), torque_mNm: real(), tip_branch: whole(), tip_along_mm: real(),
      inflation_bar: real(), balloon_mm: real(), release_mm: real(), free_rings: whole(),
      detach: whole(), coil: coil(), pressure: { now_mmHg: real(), systolic_mmHg: real(), diastolic_mmHg: real(), mean_mmHg: real() }, parts_mm: list(() => list(point)),
    })),
    devices: list((): DeviceTube => ({ matter: whole(), inner_radius_mm: real(), points: list(() => [real(), real(), real(), real()]) })),
    filled: list((): FilledDrum => ({ drum: whole(), mg_ml: real(), ends_mm: [real(), real()] })),
  };
  return { ...message, body: body(message.filled) };
}

/** No list is longer than its message. */
function limited(count: number, bytes: ArrayBuffer): number {
  if (4 * count > bytes.byteLength) throw new Error("the server's message is too short");
  return count;
}
