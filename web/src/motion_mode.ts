// One movement of the body, such as breath or heart: its phase at a time (host/xraycast/motion/motion_mode.cpp).

/** A mode's times, and the phases at which the page knows the body. */
export interface ModeHeader {
  name: string;
  wraps: boolean; // its last phase leads to its first one
  period_s?: number; // of a cycle, or of the way there and back
  waveform?: [number, number][]; // instead: times in s and phases
  phases: number[]; // of the key maps
}

interface Hermite {
  value0: number;
  slope0: number;
  value1: number;
  slope1: number;
}

/** Cubic functions of the ends' values, and of the ends' slopes times the interval. */
const hermite = (t: number): Hermite => ({
  value0: (1 + 2 * t) * (1 - t) * (1 - t), slope0: t * (1 - t) * (1 - t), value1: t * t * (3 - 2 * t), slope1: t * t * (t - 1),
});

/** The slope at a sample between a secant before and one after it, as Fritsch and Butland have it; 0 at an extreme. */
function monotone_slope(before: number, before_s: number, after: number, after_s: number): number {
  if (before * after <= 0) return 0;
  const w1 = 2 * after_s + before_s, w2 = after_s + 2 * before_s;
  return (w1 + w2) / (w1 / before + w2 / after);
}

/** The number of the last ascending value that is not above another, or of the last but one. */
function interval_of(values: readonly number[], value: number): number {
  let above = 0;
  while (above < values.length && values[above]! <= value) ++above;
  return Math.min(values.length - 2, Math.max(0, above - 1));
}

/** Samples that repeat from the last on; the phase grows as much in each repetition. */
class Waveform {
  private readonly times_s: number[];
  private readonly phases: number[];
  private readonly repeats_s: number;
  private readonly growth: number;

  constructor(samples: readonly [number, number][]) {
    this.times_s = samples.map(([time_s]) => time_s);
    this.phases = samples.map(([, phase]) => phase);
    this.repeats_s = this.times_s[this.times_s.length - 1]! - this.times_s[0]!;
    this.growth = this.phases[this.phases.length - 1]! - this.phases[0]!;
  }

  /** Of a phase that wraps, a turn. */
  cycle_s(wraps: boolean): number {
    return this.repeats_s / Math.max(1, wraps ? Math.round(Math.abs(this.growth)) : 1);
  }

  at(time_s: number): number {
    const { piece, within_s, turns } = this.place_of(time_s);
    return this.piece_at(piece, within_s) + turns * this.growth;
  }

  next(phase: number, from_s: number, wraps: boolean): number | null {
    let { piece, within_s, turns } = this.place_of(from_s);
    const pieces = this.times_s.length - 1;
    // Once through all pieces, and the first of them from its start.
    for (let count = 0; count <= pieces; ++count) {
      const found_s = this.next_in_piece(piece, phase - turns * this.growth, within_s, this.times_s[piece + 1]!, wraps);
      if (found_s !== null) return found_s + turns * this.repeats_s;
      if (++piece === pieces) {
        piece = 0;
        ++turns;
      }
      within_s = this.times_s[piece]!;
    }
    return null;
  }

  private place_of(time_s: number): { piece: number; within_s: number; turns: number } {
    const first_s = this.times_s[0]!, turns = Math.floor((time_s - first_s) / this.repeats_s);
    const within_s = Math.min(this.times_s[this.times_s.length - 1]!, Math.max(first_s, time_s - turns * this.repeats_s));
    return { piece: interval_of(this.times_s, within_s), within_s, turns };
  }

  private length_s(piece: number): number {
    return this.times_s[piece + 1]! - this.times_s[piece]!;
  }

  private secant(piece: number): number {
    return (this.phases[piece + 1]! - this.phases[piece]!) / this.length_s(piece);
  }

  private piece_at(piece: number, time_s: number): number {
    const pieces = this.times_s.length - 1;
    const slope = (before: number, after: number) =>
      monotone_slope(this.secant(before), this.length_s(before), this.secant(after), this.length_s(after));
    const h = hermite((time_s - this.times_s[piece]!) / this.length_s(piece));
    return this.phases[piece]! * h.value0 + this.phases[piece + 1]! * h.value1 +
      this.length_s(piece) * (slope((piece + pieces - 1) % pieces, piece) * h.slope0 + slope(piece, (piece + 1) % pieces) * h.slope1);
  }

  /** By bisection, for a piece is monotone. */
  private next_in_piece(piece: number, phase: number, start_s: number, end_s: number, wraps: boolean): number | null {
    const kRounding = 1e-12, at_start = this.piece_at(piece, start_s), at_end = this.phases[piece + 1]!;
    const direction = at_end < at_start ? -1 : 1;
    // The first in the way, of those that are a whole number away.
    const target = wraps ? phase + direction * Math.ceil(direction * (at_start - phase) - kRounding) : phase;
    const to_go = direction * (target - at_start);
    if (to_go < -kRounding || to_go > direction * (at_end - at_start) + kRounding) return null;
    if (to_go <= kRounding) return start_s;
    let before_s = start_s, after_s = end_s;
    for (let step = 0; step < 60; ++step) {
      const middle_s = 0.5 * (before_s + after_s);
      if (direction * (this.piece_at(piece, middle_s) - target) < 0) before_s = middle_s;
      else after_s = middle_s;
    }
    return after_s;
  }
}

export class MotionMode {
  readonly name: string;
  readonly wraps: boolean;
  private readonly period_s: number;
  private readonly waveform: Waveform | null;

  constructor({ name, wraps, period_s, waveform }: Omit<ModeHeader, "phases">) {
    this.name = name;
    this.wraps = wraps;
    this.period_s = period_s ?? 1;
    this.waveform = waveform ? new Waveform(waveform) : null;
  }

  /** In which it has all its phases. */
  get cycle_s(): number {
    return this.waveform ? this.waveform.cycle_s(this.wraps) : this.period_s;
  }

  /** At a time before or after any number of repetitions, 0 to 1. */
  phase_at(time_s: number): number {
    if (!this.waveform) {
      const turns = time_s / this.period_s, share = turns - Math.floor(turns);
      return this.wraps ? share : 0.5 * (1 - Math.cos(2 * Math.PI * share));
    }
    const phase = this.waveform.at(time_s);
    return this.wraps ? phase - Math.floor(phase) : Math.min(1, Math.max(0, phase));
  }

  /** The first time at or after another at which it has a phase, 0 to 1; none where a waveform never has it. */
  next_time_s(phase: number, from_s: number): number | null {
    if (this.waveform) return this.waveform.next(phase, from_s, this.wraps);
    const { period_s } = this, there = this.wraps ? phase - Math.floor(phase) : Math.acos(1 - 2 * phase) / (2 * Math.PI);
    const first_from = (share: number) => period_s * (Math.ceil(from_s / period_s - share) + share);
    return Math.min(first_from(there), first_from(this.wraps ? there : 1 - there));
  }
}

/** How much the values at ascending phases count at a phase: of a Catmull-Rom spline through them, closed where the phases wrap. */
export function phase_weights(phases: readonly number[], wraps: boolean, phase: number): number[] {
  const count = phases.length, weights = new Array<number>(count).fill(0);
  const index = (k: number) => ((k % count) + count) % count;
  const phase_of = (k: number) => phases[index(k)]! + Math.floor(k / count);
  let below = 0;
  if (wraps) {
    if (phase < phases[0]!) phase += 1;
    while (below + 1 < count && phase_of(below + 1) <= phase) ++below;
  } else below = interval_of(phases, phase);
  const start = phase_of(below), length = phase_of(below + 1) - start, h = hermite((phase - start) / length);
  const add = (k: number, weight: number) => (weights[index(k)]! += weight);
  add(below, h.value0);
  add(below + 1, h.value1);
  const add_slope = (key: number, weight: number) => {
    const before = wraps || key > 0 ? key - 1 : key, after = wraps || key + 1 < count ? key + 1 : key;
    const per_phase = (weight * length) / (phase_of(after) - phase_of(before));
    add(after, per_phase);
    add(before, -per_phase);
  };
  add_slope(below, h.slope0);
  add_slope(below + 1, h.slope1);
  return weights;
}
