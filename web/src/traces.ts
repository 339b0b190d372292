// What a monitor shows of a body in motion over the last seconds: of the heart its ECG, of any other mode its phase, with a mark at
// each exposure and a line at the phase of a gate.
export const kTraceLength_s = 6;
const kSample_s = 1 / 200; // as an ECG wants it

/** Of one mode: values from 0 to 1, the newest last. */
export interface Trace {
  name: string;
  is_held: boolean;
  gate: number | null; // the phase that exposures wait for
  values: readonly number[];
}

export interface Traces {
  modes: readonly Trace[];
  step_s: number; // between values
  length_s: number; // of the whole width
  exposures_s: readonly number[]; // before the end
}

/** What a page's own clock has shown, one list a mode, at even times. */
export class TraceLog {
  readonly traces: number[][];
  private next_s = -kTraceLength_s;

  constructor(modes: number) {
    this.traces = Array.from({ length: modes }, () => []);
  }

  /** Up to a time, while nothing is held or released. */
  add(traces_at: (time_s: number) => readonly number[], until_s: number): void {
    if (until_s < this.next_s - 1) this.clear(until_s);
    this.next_s = Math.max(this.next_s, until_s - kTraceLength_s);
    for (; this.next_s <= until_s; this.next_s += kSample_s) traces_at(this.next_s).forEach((value, m) => this.traces[m]!.push(value));
    const most = Math.ceil(kTraceLength_s / kSample_s) + 1;
    for (const trace of this.traces) trace.splice(0, Math.max(0, trace.length - most));
  }

  shown(state_of: (m: number) => Pick<Trace, "name" | "is_held" | "gate">): Traces {
    return { modes: this.traces.map((values, m) => ({ ...state_of(m), values })), step_s: kSample_s, length_s: kTraceLength_s, exposures_s: [] };
  }

  /** Of another time: what led up to it. */
  private clear(until_s: number): void {
    for (const trace of this.traces) trace.length = 0;
    this.next_s = until_s - kTraceLength_s;
  }
}

const name_of = (mode: Trace): string => (mode.name === "heart" ? "ECG" : mode.name) + (mode.is_held ? ", held" : "");

/** What the traces show, in words. */
export const traces_text = ({ modes, exposures_s, length_s }: Traces): string =>
  `${modes.map(name_of).join("; ")}; ${exposures_s.length} exposures in the last ${length_s} s`;

/** One below the other. */
export function draw_traces(canvas: HTMLCanvasElement, { modes, step_s, length_s, exposures_s }: Traces): void {
  const scale = devicePixelRatio, width = Math.round(canvas.clientWidth * scale), height = Math.round(canvas.clientHeight * scale);
  if (width === 0 || height === 0) return;
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
  const context = canvas.getContext("2d")!, style = getComputedStyle(canvas), row = height / Math.max(1, modes.length), edge = 4 * scale;
  context.clearRect(0, 0, width, height);
  context.fillStyle = style.getPropertyValue("--mark");
  for (const age_s of exposures_s) context.fillRect(width * (1 - age_s / length_s) - 0.5 * scale, height - 6 * scale, scale, 6 * scale);
  context.font = `${11 * scale}px system-ui, sans-serif`;
  context.lineJoin = "round";
  modes.forEach((mode, m) => {
    const last = mode.values.length - 1, y_of = (value: number) => (m + 1) * row - edge - value * (row - 2 * edge);
    context.strokeStyle = context.fillStyle = style.getPropertyValue(mode.name === "heart" ? "--ecg" : "--breath");
    context.lineWidth = 1.5 * scale;
    context.beginPath();
    mode.values.forEach((value, i) => context.lineTo(width * (1 - ((last - i) * step_s) / length_s), y_of(value)));
    context.stroke();
    context.fillText(name_of(mode), 4 * scale, m * row + 12 * scale);
    if (mode.gate === null || mode.name === "heart") return; // a phase of the heart is no height of its ECG
    context.setLineDash([4 * scale, 4 * scale]);
    context.lineWidth = scale;
    context.beginPath();
    context.moveTo(0, y_of(mode.gate));
    context.lineTo(width, y_of(mode.gate));
    context.stroke();
    context.setLineDash([]);
  });
}
