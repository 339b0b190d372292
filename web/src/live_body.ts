// The body of a live session: its traces on the page, and the buttons and keys that hold modes, gate exposures and change the speed.
import { LiveBody, kTraceStep_s } from "./live_message";
import { Traces, draw_traces, kTraceLength_s, traces_text } from "./traces";

const element = <T extends HTMLElement>(id: string) => document.getElementById(id) as T;

const kKeptValues = Math.round(kTraceLength_s / kTraceStep_s);
const kRest = 0.75; // of a beat: where a heart rests

/** What the server is asked to change (docs/web.md). */
export interface BodyChange {
  hold?: Record<string, boolean | number>; // where it is, or at a phase
  speed?: number;
  gate?: { mode: string; phase: number } | null;
}

/** The last seconds of messages, of which some may be missing. */
export class LastTraces {
  private readonly values: number[][];
  private exposures_s: number[] = [];
  private end_s = -Infinity;
  private is_held: boolean[] = [];
  private gates: (number | null)[] = [];
  constructor(private readonly names: readonly string[]) {
    this.values = names.map(() => []);
  }

  add({ time_s, modes, exposures_s }: LiveBody): void {
    const values = this.values, count = modes[0]?.trace.length ?? 0;
    const is_torn = Math.abs(time_s - this.end_s - count * kTraceStep_s) > kTraceStep_s;
    values.forEach((kept, m) => {
      if (is_torn) kept.length = 0;
      kept.push(...(modes[m]?.trace ?? []));
      kept.splice(0, kept.length - kKeptValues);
    });
    this.exposures_s = [...this.exposures_s, ...exposures_s].filter((at_s) => at_s > time_s - kTraceLength_s && at_s <= time_s + 1);
    this.is_held = modes.map(({ is_held }) => is_held);
    this.gates = modes.map(({ gate }) => gate);
    this.end_s = time_s;
  }

  get shown(): Traces {
    return {
      modes: this.names.map((name, m) => ({ name, is_held: this.is_held[m] ?? false, gate: this.gates[m] ?? null, values: this.values[m]! })), step_s: kTraceStep_s,
      length_s: kTraceLength_s, exposures_s: this.exposures_s.map((at_s) => Math.max(0, this.end_s - at_s)),
    };
  }
}

/** What a button says that holds a mode. */
const words_of_hold = (mode: string): string => (mode === "heart" ? "Arrest heart" : `Hold ${mode}`);

/** The mode that a breath hold holds: that of the name, or else the first that is no heart. */
export const breath_of = (modes: readonly string[]): string | undefined => modes.find((mode) => mode === "breath") ?? modes.find((mode) => mode !== "heart");

export class BodyControls {
  private readonly canvas = element<HTMLCanvasElement>("live-traces");
  private readonly traces: LastTraces;
  private readonly holds: HTMLButtonElement[];
  private newest: LiveBody | null = null;

  constructor(private readonly names: readonly string[], private readonly change: (body: BodyChange) => void) {
    this.traces = new LastTraces(names);
    for (const id of ["body-buttons", "live-traces"]) element(id).hidden = false;
    this.holds = names.map((name) => {
      const button = Object.assign(document.createElement("button"), { type: "button", textContent: words_of_hold(name) });
      button.addEventListener("click", () => this.toggle_hold(name));
      element("body-holds").append(button);
      return button;
    });
    element("gate").addEventListener("click", () => this.toggle_gate());
    element<HTMLSelectElement>("body-speed").addEventListener("change", ({ target }) => this.change({ speed: Number((target as HTMLSelectElement).value) }));
    new ResizeObserver(() => this.draw()).observe(this.canvas);
  }

  told(body: LiveBody): void {
    this.newest = body;
    this.traces.add(body);
  }

  draw(): void {
    draw_traces(this.canvas, this.traces.shown);
  }

  /** Also in words, and how the buttons are. */
  show(): void {
    const body = this.newest;
    if (!body) return;
    this.canvas.setAttribute("aria-label", traces_text(this.traces.shown));
    this.holds.forEach((button, m) => button.setAttribute("aria-pressed", String(body.modes[m]?.is_held ?? false)));
    element("gate").setAttribute("aria-pressed", String(body.modes.some(({ gate }) => gate !== null)));
    const choice = element<HTMLSelectElement>("body-speed");
    if (document.activeElement !== choice) choice.value = String(body.speed);
  }

  /** What is not as in a patient who breathes, for the readout. */
  get state(): string {
    const body = this.newest;
    if (!body) return "";
    const held = this.names.filter((_, m) => body.modes[m]?.is_held).map((name) => (name === "heart" ? "heart arrested" : `${name} held`));
    const gates = this.names.flatMap((name, m) => (body.modes[m]?.gate == null ? [] : [`gated: ${name} at ${Math.round(100 * body.modes[m]!.gate!)} %`]));
    return [...held, ...(body.speed === 1 ? [] : [`motion ${Number(body.speed.toPrecision(3))}×`]), ...gates].join(", ");
  }

  /** B, K and G, as in the viewer's window but for its W. */
  takes(key: string): boolean {
    const name = key === "b" ? breath_of(this.names) : key === "k" ? this.names.find((mode) => mode === "heart") : undefined;
    if (name !== undefined) this.toggle_hold(name);
    else if (key === "g") this.toggle_gate();
    return name !== undefined || key === "g";
  }

  private toggle_hold(name: string): void {
    this.change({ hold: { [name]: !(this.newest?.modes[this.names.indexOf(name)]?.is_held ?? false) } });
  }

  private toggle_gate(): void {
    const is_gated = this.newest?.modes.some(({ gate }) => gate !== null);
    const heart = this.names.find((name) => name === "heart");
    this.change({ gate: is_gated ? null : heart ? { mode: heart, phase: kRest } : { mode: this.names[0]!, phase: 0 } });
  }
}
