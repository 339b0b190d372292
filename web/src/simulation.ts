// The simulation, compiled to WebAssembly from the program's sources (web/native/trainer.cpp).
import type { BodyChange } from "./live_body";
import { instance_of } from "./wasm_instance";

interface Exports {
  memory: WebAssembly.Memory;
  room_for(count: number): number;
  trainer_open(): number;
  trainer_hold(push: number, turn: number, is_slow: boolean, pedal: boolean, injects: boolean): void;
  trainer_pulse_rate(per_s: number): void;
  trainer_dose(fluoroscopy_s: number, air_kerma_mGy: number, dap_Gycm2: number): void;
  trainer_hold_mode(mode: number, holds: boolean, phase: number): number;
  trainer_speed(factor: number): number;
  trainer_gate(mode: number, phase: number): number;
  trainer_next_hub(): void;
  trainer_valve(): void;
  trainer_exchange(instrument: number, choice: number): number;
  trainer_inflate(instrument: number, bar: number): void;
  trainer_draw_sheath(instrument: number, mm: number): void;
  trainer_detach(instrument: number): void;
  trainer_particles(mm: number): void;
  trainer_advance(steps: number): void;
  trainer_follow(): void;
  trainer_report(has_series: boolean): number;
  trainer_take_steps(): number;
  trainer_message(): number;
  trainer_message_size(): number;
}

/** What a hand holds down. */
export interface HandHolds {
  push: number; // -1 to 1
  turn: number;
  slow: boolean;
  pedal: boolean;
  inject: boolean;
}

export interface Dose {
  fluoroscopy_s: number;
  air_kerma_mGy: number;
  dap_Gycm2: number;
}

/** Of a hub's pose; see `follow`. */
export const kPoseNumbers = 5;

export class Simulation {
  private constructor(private readonly calls: Exports) {}

  /** Of an exported page's setup (viewer/xraycast/trainer/trainer_setup.hpp). Throws where that is damaged. */
  static async of(code: WebAssembly.Module | BufferSource, setup: Float64Array): Promise<Simulation> {
    const simulation = new Simulation((await instance_of(code)).exports as unknown as Exports);
    simulation.put(setup);
    const failure = simulation.text_at(simulation.calls.trainer_open());
    if (failure !== null) throw new Error(failure);
    return simulation;
  }

  hold({ push, turn, slow, pedal, inject }: HandHolds): void {
    this.calls.trainer_hold(push, turn, slow, pedal, inject);
  }

  /** Exposures a second while the pedal is down, in place of one a message. */
  set_pulse_rate(per_s: number): void {
    this.calls.trainer_pulse_rate(per_s);
  }

  /** What the fluoroscope has given so far. */
  count_dose({ fluoroscopy_s, air_kerma_mGy, dap_Gycm2 }: Dose): void {
    this.calls.trainer_dose(fluoroscopy_s, air_kerma_mGy, dap_Gycm2);
  }

  hold_next_hub(): void {
    this.calls.trainer_next_hub();
  }

  toggle_valve(): void {
    this.calls.trainer_valve();
  }

  /** Why it was refused, or null. */
  exchange(instrument: number, choice: number): string | null {
    return this.text_at(this.calls.trainer_exchange(instrument, choice));
  }

  /** To a pressure in bar. */
  inflate(instrument: number, bar: number): void {
    this.calls.trainer_inflate(instrument, bar);
  }

  draw_sheath(instrument: number, mm: number): void {
    this.calls.trainer_draw_sheath(instrument, mm);
  }

  /** The coil on its wire. */
  detach(instrument: number): void {
    this.calls.trainer_detach(instrument);
  }

  /** Particles of this diameter, 0 for none, into the agent. */
  mix_in(mm: number): void {
    this.calls.trainer_particles(mm);
  }

  /** Of a body in motion, whose modes have these names. Why it was refused, or null. */
  change_body({ hold, speed, gate }: BodyChange, modes: readonly string[]): string | null {
    const { calls } = this, refusals: (string | null)[] = [];
    for (const [name, held] of Object.entries(hold ?? {}))
      refusals.push(this.text_at(calls.trainer_hold_mode(modes.indexOf(name), held !== false, typeof held === "number" ? held : -1)));
    if (speed !== undefined) refusals.push(this.text_at(calls.trainer_speed(speed)));
    if (gate !== undefined) refusals.push(this.text_at(calls.trainer_gate(gate ? modes.indexOf(gate.mode) : -1, gate?.phase ?? 0)));
    return refusals.find((refusal) => refusal !== null) ?? null;
  }

  /** So many milliseconds as the hand moves. */
  advance(steps: number): void {
    this.calls.trainer_advance(steps);
  }

  /** A step to a pose of each hub: an insertion in mm, a rotation in rad, a balloon's pressure in bar, a sheath drawn back in mm, coils that were to be detached. Of each instrument: its tip's x, y, z in mm, force in N and torque in N m. */
  follow(poses: Float64Array): Float64Array {
    const instruments = poses.length / kPoseNumbers;
    if (!Number.isInteger(instruments)) throw new Error(`a pose has ${kPoseNumbers} numbers`);
    this.put(poses);
    this.calls.trainer_follow();
    const at = this.calls.room_for(5 * instruments);
    return new Float64Array(this.calls.memory.buffer, at, 5 * instruments).slice();
  }

  /** What the instruments did so far, as JSON; see report.ts. */
  report(has_series: boolean): string {
    return this.text_at(this.calls.trainer_report(has_series))!;
  }

  /** Of each step since this was asked before: the time in s, and a pose of each hub, as `follow` takes them. */
  take_steps(): Float64Array {
    const count = this.calls.trainer_take_steps();
    return new Float64Array(this.calls.memory.buffer, this.calls.room_for(count), count).slice();
  }

  /** As a server's; see live_message.ts. */
  message(): ArrayBuffer {
    const at = this.calls.trainer_message();
    return this.calls.memory.buffer.slice(at, at + this.calls.trainer_message_size());
  }

  private put(numbers: Float64Array): void {
    const at = this.calls.room_for(numbers.length); // memory may grow, and has another buffer then
    new Float64Array(this.calls.memory.buffer, at, numbers.length).set(numbers);
  }

  private text_at(at: number): string | null {
    if (at === 0) return null;
    const bytes = new Uint8Array(this.calls.memory.buffer);
    return new TextDecoder().decode(bytes.subarray(at, bytes.indexOf(0, at)));
  }
}
