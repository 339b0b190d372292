// The body's motion: it goes on, is held, or is shown at one phase alone; with the traces of its modes.
import { BodyClock } from "./body_clock";
import type { Motion } from "./data";
import { TraceLog, draw_traces } from "./traces";
import { MotionMode } from "./motion_mode";
import { Rhythm } from "./rhythm";
import { step_s } from "./run_player";
import type { State, Store } from "./state";

const element = <T extends HTMLElement>(id: string) => document.getElementById(id) as T;

const kHolds: Record<string, string> = { breath: "Hold breath", heart: "Arrest heart" };

/** Exposures wait for a phase of a mode. */
export interface Gate {
  m: number;
  phase: number;
}

/** What is shown of a body whose time goes on: all instants, or those alone at which a gate opens. */
export class ShownPhases {
  private phases: number[];
  constructor(private readonly clock: BodyClock) {
    this.phases = clock.phases();
  }

  /** After so many seconds. */
  advance(seconds: number, gate: Gate | null): number[] {
    const { clock } = this, from_s = clock.time_s, until_s = from_s + seconds;
    if (!gate) {
      clock.advance(seconds);
      return (this.phases = clock.phases());
    }
    // The last opening of the gate until then.
    for (let at_s = clock.next_instant(gate.m, gate.phase, from_s); at_s !== null && at_s <= until_s; at_s = clock.next_instant(gate.m, gate.phase, at_s + 1e-3)) this.phases = clock.phases_at(at_s);
    clock.advance(seconds);
    return this.phases;
  }
}

export class MotionPlayer {
  private readonly clock: BodyClock;
  private readonly shown: ShownPhases;
  private readonly log: TraceLog;
  private readonly names: readonly string[];
  private readonly holds: HTMLButtonElement[];
  private readonly play = element<HTMLButtonElement>("motion-play");
  private readonly speed = element<HTMLSelectElement>("motion-speed");
  private readonly gate_mode = element<HTMLSelectElement>("gate-mode");
  private readonly gate_phase = element<HTMLInputElement>("gate-phase");
  private readonly chart = element<HTMLCanvasElement>("motion-chart");
  private gate: Gate | null = null;
  private last_gate: Gate;
  private plays = false;
  private last_ms = 0;

  constructor(motion: Motion, private readonly store: Store) {
    this.names = motion.modes.map(({ name }) => name);
    this.clock = new BodyClock(motion.modes.map((mode) => new MotionMode(mode)));
    this.clock.speed = motion.speed;
    this.names.forEach((name, m) => motion.held[name] !== undefined && this.clock.hold(m, motion.held[name]));
    this.take_up(store.state);
    this.shown = new ShownPhases(this.clock);
    this.log = new TraceLog(this.names.length);
    this.holds = this.names.map((name, m) => this.hold_button(name, m));
    element("holds").append(...this.holds);
    this.fill_speeds(motion.speed);
    this.gate_mode.append(new Option("off", ""), ...this.names.map((name, m) => new Option(name, String(m))));
    const heart = Math.max(0, this.names.indexOf("heart"));
    this.last_gate = { m: heart, phase: this.names[heart] === "heart" ? 0.75 : 0 };
    if (motion.gate) this.set_gate({ m: Math.max(0, this.names.indexOf(motion.gate.mode)), phase: motion.gate.phase });
    else this.set_gate(null);
    this.play.addEventListener("click", () => this.toggle());
    this.speed.addEventListener("change", () => (this.clock.speed = Number(this.speed.value)));
    this.gate_mode.addEventListener("change", () => this.set_gate(this.gate_mode.value === "" ? null : { m: Number(this.gate_mode.value), phase: this.last_gate.phase }));
    this.gate_phase.addEventListener("input", () => this.set_gate({ ...this.last_gate, phase: Number(this.gate_phase.value) }));
    new ResizeObserver(() => this.draw()).observe(this.chart);
    element("motion").hidden = false;
    this.log.add((time_s) => this.clock.traces_at(time_s), 0);
    this.mark();
  }

  get is_playing(): boolean {
    return this.plays;
  }

  start(): void {
    if (this.plays) return;
    this.plays = true;
    this.take_up(this.store.state);
    this.store.update({ is_paused: false });
    this.mark();
    requestAnimationFrame((ms) => {
      this.last_ms = ms;
      this.advance(ms);
    });
  }

  /** At the phases that are shown. */
  pause(): void {
    this.plays = false;
    this.store.update({ is_paused: true });
    this.mark();
  }

  toggle(): void {
    if (this.plays) this.pause();
    else this.start();
  }

  /** Holds a mode where it is, or lets it go on; none of that name: nothing. */
  toggle_hold(name: string): void {
    const m = this.names.indexOf(name);
    if (m >= 0) this.toggle_mode(m);
  }

  toggle_gate(): void {
    this.set_gate(this.gate ? null : this.last_gate);
  }

  draw(): void {
    draw_traces(this.chart, this.log.shown((m) => ({ name: this.names[m]!, is_held: this.clock.is_held(m), gate: this.gate?.m === m ? this.gate.phase : null })));
  }

  /** Another state came by the address. */
  changed({ is_paused }: State, before: State): void {
    if (is_paused && !before.is_paused && this.plays) {
      this.plays = false;
      this.mark();
    }
  }

  private toggle_mode(m: number): void {
    if (this.clock.is_held(m)) this.clock.release(m);
    else this.clock.hold(m);
    this.mark();
  }

  /** The clock goes on from the phases that are shown, which an address may have named. */
  private take_up({ phases, is_paused }: State): void {
    if (!is_paused || this.gate) return;
    phases.forEach((phase, m) => {
      const is_held = this.clock.is_held(m);
      if (Math.abs((this.clock.phases()[m] ?? 0) - phase) < 1e-9) return;
      this.clock.hold(m, phase);
      if (!is_held) this.clock.release(m);
    });
  }

  private advance(now_ms: number): void {
    if (!this.plays) return;
    const seconds = step_s(this.last_ms, now_ms, 1);
    this.last_ms = now_ms;
    this.log.add((time_s) => this.clock.traces_at(time_s), this.clock.time_s + seconds);
    const phases = this.shown.advance(seconds, this.gate);
    if (phases.some((phase, m) => phase !== this.store.state.phases[m])) this.store.update({ phases });
    this.draw();
    requestAnimationFrame((ms) => this.advance(ms));
  }

  private set_gate(gate: Gate | null): void {
    this.gate = gate;
    this.last_gate = gate ?? this.last_gate;
    this.gate_mode.value = gate ? String(gate.m) : "";
    this.gate_phase.value = String(this.last_gate.phase);
    element("gate-phase-label").hidden = !gate;
    element("gate-readout").textContent = this.last_gate.phase.toFixed(2);
    this.draw();
  }

  private hold_button(name: string, m: number): HTMLButtonElement {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = kHolds[name] ?? `Hold ${name}`;
    button.addEventListener("click", () => this.toggle_mode(m));
    return button;
  }

  /** The usual ones, and that of the page. */
  private fill_speeds(given: number): void {
    const usual = [0.25, 0.5, 1, 2, 4], all = [...new Set([...usual, given])].sort((a, b) => a - b);
    this.speed.append(...all.map((factor) => new Option(({ 0.25: "¼", 0.5: "½" } as Record<number, string>)[factor] ?? String(factor), String(factor), factor === given, factor === given)));
  }

  private mark(): void {
    this.draw();
    this.play.textContent = this.plays ? "Pause body" : "Move body";
    this.holds.forEach((button, m) => button.setAttribute("aria-pressed", String(this.clock.is_held(m))));
    const held = this.names.filter((_, m) => this.clock.is_held(m));
    this.chart.setAttribute("aria-label", `Traces of ${this.names.map((name) => (name === "heart" ? "the heart (ECG)" : name)).join(" and ")}${held.length > 0 ? `; ${held.join(" and ")} held` : ""}`);
  }
}

/** The traces of a body that moves with a run. */
export class RunTraces {
  private readonly names: readonly string[];
  private readonly held: ReadonlySet<string>;
  private readonly rhythm: Rhythm;
  private readonly chart = element<HTMLCanvasElement>("motion-chart");

  constructor(motion: Motion, private readonly store: Store) {
    this.names = motion.modes.map(({ name }) => name);
    this.held = new Set(Object.keys(motion.held));
    this.rhythm = new Rhythm(motion);
    element("motion").hidden = false;
    element("motion-controls").hidden = true;
    this.chart.setAttribute("aria-label", `Traces of ${this.names.join(" and ")} in the run`);
    new ResizeObserver(() => this.draw()).observe(this.chart);
  }

  draw(): void {
    const log = new TraceLog(this.names.length);
    log.add((time_s) => this.rhythm.traces_at(time_s), this.store.state.time_s);
    draw_traces(this.chart, log.shown((m) => ({ name: this.names[m]!, is_held: this.held.has(this.names[m]!), gate: null })));
  }
}
