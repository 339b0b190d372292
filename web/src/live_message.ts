// What the server tells of a live session, once a frame (viewer/xraycast/serving/browser_message.hpp).
import type { Vec3 } from "./vectors";

export interface LiveInstrument {
  insertion_mm: number;
  rotation_deg: number;
  force_N: number;
  torque_mNm: number;
  /** At the last exposure: the control points of each part's curve. */
  parts_mm: Vec3[][];
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
  instruments: LiveInstrument[]; // from the outermost on
  filled: { drum: number; mg_ml: number }[]; // with contrast agent
}

const kFormat = 1;

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
  return {
    exposes: (flags & 1) !== 0, injects: (flags & 2) !== 0, is_valve_locked: (flags & 4) !== 0, has_outlet: (flags & 8) !== 0, held_hub,
    exposures: whole(), time_s: real(), fluoroscopy_s: real(), injected_ml: real(),
    instruments: Array.from({ length: instruments }, () => ({
      insertion_mm: real(), rotation_deg: real(), force_N: real(), torque_mNm: real(), parts_mm: list(() => list(point)),
    })),
    filled: list(() => ({ drum: whole(), mg_ml: real() })),
  };
}

/** No list is longer than its message. */
function limited(count: number, bytes: ArrayBuffer): number {
  if (4 * count > bytes.byteLength) throw new Error("the server's message is too short");
  return count;
}
