// The phases of a body that moves with a run: those of its time, but for modes that are held.
import type { Motion } from "./data";
import { ecg } from "./body_clock";
import { MotionMode } from "./motion_mode";

export class Rhythm {
  private readonly modes: MotionMode[];
  constructor(private readonly motion: Pick<Motion, "modes" | "held" | "speed">) {
    this.modes = motion.modes.map((mode) => new MotionMode(mode));
  }

  phases_at(time_s: number): number[] {
    return this.modes.map((mode) => this.motion.held[mode.name] ?? mode.phase_at(this.motion.speed * time_s));
  }

  /** As BodyClock.traces_at. */
  traces_at(time_s: number): number[] {
    return this.phases_at(time_s).map((phase, m) => (this.modes[m]!.name === "heart" ? ecg(phase) : phase));
  }
}
