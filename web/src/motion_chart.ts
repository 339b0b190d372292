// What a monitor shows of the body's modes over the last seconds: of the heart its ECG, of any other its phase.
const kShown_s = 6;
const kSample_s = 1 / 200; // as an ECG wants it

/** What was shown, one list a mode, at even times. */
export class TraceLog {
  readonly traces: number[][];
  private next_s = -kShown_s;

  constructor(modes: number) {
    this.traces = Array.from({ length: modes }, () => []);
  }

  /** Up to a time, while nothing is held or released. */
  add(traces_at: (time_s: number) => readonly number[], until_s: number): void {
    if (until_s < this.next_s - 1) this.clear(until_s);
    this.next_s = Math.max(this.next_s, until_s - kShown_s);
    for (; this.next_s <= until_s; this.next_s += kSample_s) traces_at(this.next_s).forEach((value, m) => this.traces[m]!.push(value));
    const most = Math.ceil(kShown_s / kSample_s) + 1;
    for (const trace of this.traces) trace.splice(0, Math.max(0, trace.length - most));
  }

  /** Of another time: what led up to it. */
  private clear(until_s: number): void {
    for (const trace of this.traces) trace.length = 0;
    this.next_s = until_s - kShown_s;
  }
}

const kColours: Record<string, string> = { heart: "--ecg" };

/** A row for each mode, the newest on the right. */
export function draw_traces(canvas: HTMLCanvasElement, names: readonly string[], log: TraceLog, gate: { m: number; phase: number } | null): void {
  const scale = devicePixelRatio, width = Math.round(canvas.clientWidth * scale), height = Math.round(canvas.clientHeight * scale);
  if (width === 0 || height === 0) return;
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
  const context = canvas.getContext("2d")!, style = getComputedStyle(canvas), row = height / names.length;
  const label_px = 58 * scale, most = kShown_s / kSample_s;
  context.clearRect(0, 0, width, height);
  context.font = `${11 * scale}px system-ui, sans-serif`;
  context.textBaseline = "middle";
  context.lineJoin = "round";
  names.forEach((name, m) => {
    const trace = log.traces[m]!, first = most - (trace.length - 1), y_of = (value: number) => (m + 1) * row - 4 * scale - value * (row - 8 * scale);
    context.strokeStyle = context.fillStyle = style.getPropertyValue(kColours[name] ?? "--breath");
    context.fillText(name === "heart" ? "ECG" : name, 4 * scale, (m + 0.5) * row, label_px - 8 * scale);
    context.lineWidth = 1.5 * scale;
    context.beginPath();
    trace.forEach((value, i) => context.lineTo(label_px + ((first + i) / most) * (width - label_px - 2 * scale), y_of(value)));
    context.stroke();
    if (gate?.m !== m || name === "heart") return; // a phase of the heart is no height of its ECG
    context.setLineDash([4 * scale, 4 * scale]);
    context.lineWidth = scale;
    context.beginPath();
    context.moveTo(label_px, y_of(gate.phase));
    context.lineTo(width, y_of(gate.phase));
    context.stroke();
    context.setLineDash([]);
  });
}
