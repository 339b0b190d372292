// The clock of a body in motion (host/xraycast/motion/body_clock.hpp): the phase of each of its modes as time advances. A mode
// has a time of its own, which stops while it is held and passes faster or slower with its speed, so that nothing jumps.
import type { MotionMode } from "./motion_mode";

const kRounding_s = 1e-9;

/** The P, Q, R, S and T waves of McSharry et al.: where they lie about the R wave, how wide and how high they are. */
const kWaves: readonly (readonly [angle: number, width: number, height: number])[] = [
  [-Math.PI / 3, 0.25, 1.2 * 0.25 * 0.25], [-Math.PI / 12, 0.1, -5 * 0.1 * 0.1], [0, 0.1, 30 * 0.1 * 0.1],
  [Math.PI / 12, 0.1, -7.5 * 0.1 * 0.1], [Math.PI / 2, 0.4, 0.75 * 0.4 * 0.4],
];

/** Math.round takes halves up, C++ away from zero: half a turn is as far either way. */
function sum_of_waves(heart_phase: number): number {
  let sum = 0;
  for (const [angle, width, height] of kWaves) {
    const turns = heart_phase - angle / (2 * Math.PI), away = (2 * Math.PI * (turns - Math.round(turns))) / width;
    sum += height * Math.exp(-0.5 * away * away);
  }
  return sum;
}

/** The least and the greatest sum, at the S and the R wave. */
const [kLeast, kGreatest] = (() => {
  const sums = Array.from({ length: 10000 }, (_, i) => sum_of_waves(i / 10000));
  return [sums.reduce((a, b) => Math.min(a, b)), sums.reduce((a, b) => Math.max(a, b))];
})();

/** What an ECG shows at a phase of the heart, the share of the beat since the R wave: 0 to 1. Drawn, not measured. */
export const ecg = (heart_phase: number): number =>
  Math.min(1, Math.max(0, (sum_of_waves(heart_phase) - kLeast) / (kGreatest - kLeast)));

interface ClockMode {
  readonly motion: MotionMode;
  time_s: number; // of its own
  is_held: boolean;
}

export class BodyClock {
  private readonly modes: ClockMode[];
  private speed_ = 1;

  constructor(modes: readonly MotionMode[], private now_s = 0) {
    this.modes = modes.map((motion) => ({ motion, time_s: now_s, is_held: false }));
  }

  get time_s(): number {
    return this.now_s;
  }

  get speed(): number {
    return this.speed_;
  }

  /** Of all modes, 0 to 100. */
  set speed(factor: number) {
    this.speed_ = factor;
  }

  /** Seconds pass, 0 or more. */
  advance(seconds: number): void {
    for (const mode of this.modes) mode.time_s += this.rate_of(mode) * seconds;
    this.now_s += seconds;
  }

  /** One phase a mode, at another time as if holds and speed were always what they are now. */
  phases_at(time_s: number): number[] {
    return this.modes.map((mode) => mode.motion.phase_at(this.own_time_s(mode, time_s)));
  }

  phases(): number[] {
    return this.phases_at(this.now_s);
  }

  /** What a monitor shows of each mode at such a time, 0 to 1: of a heart its ECG, of any other its phase. */
  traces_at(time_s: number): number[] {
    return this.phases_at(time_s).map((phase, m) => (this.modes[m]!.motion.name === "heart" ? ecg(phase) : phase));
  }

  /** Stops a mode where it is; at a phase, if that is given and it ever has it: then it goes on from there. */
  hold(m: number, phase?: number): boolean {
    const mode = this.modes[m]!, own_s = phase === undefined ? mode.time_s : mode.motion.next_time_s(phase, mode.time_s - kRounding_s);
    if (own_s === null) return false;
    mode.time_s = own_s;
    return (mode.is_held = true);
  }

  release(m: number): void {
    this.modes[m]!.is_held = false;
  }

  is_held(m: number): boolean {
    return this.modes[m]!.is_held;
  }

  /** The first instant, at or after another, at which a mode has a phase: when a gate opens. None where it never will. */
  next_instant(m: number, phase: number, at_or_after_s: number): number | null {
    const gate = this.modes[m]!, rate = this.rate_of(gate), own_s = this.own_time_s(gate, at_or_after_s);
    if (rate === 0) {
      const away = Math.abs(gate.motion.phase_at(own_s) - phase), is_there = away < 1e-9 || (gate.motion.wraps && 1 - away < 1e-9);
      return is_there ? at_or_after_s : null;
    }
    const found_s = gate.motion.next_time_s(phase, own_s - kRounding_s * rate);
    return found_s === null ? null : Math.max(at_or_after_s, this.now_s + (found_s - gate.time_s) / rate);
  }

  private rate_of(mode: ClockMode): number {
    return mode.is_held ? 0 : this.speed_;
  }

  private own_time_s(mode: ClockMode, time_s: number): number {
    return mode.time_s + this.rate_of(mode) * (time_s - this.now_s);
  }
}
