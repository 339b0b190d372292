// ECG and breath of a body in motion as a monitor shows them, over the last seconds, with a mark at each exposure.

/** Of one mode: values from 0 to 1, the newest last. */
export interface Trace {
  name: string;
  is_held: boolean;
  values: readonly number[];
}

export interface Traces {
  modes: readonly Trace[];
  step_s: number; // between values
  length_s: number; // of the whole width
  exposures_s: readonly number[]; // before the end
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
  modes.forEach((mode, m) => {
    const bottom = (m + 1) * row - edge, last = mode.values.length - 1;
    context.strokeStyle = context.fillStyle = style.getPropertyValue(mode.name === "heart" ? "--ecg" : "--breath");
    context.lineWidth = 1.5 * scale;
    context.beginPath();
    mode.values.forEach((value, i) => context.lineTo(width * (1 - ((last - i) * step_s) / length_s), bottom - value * (row - 2 * edge)));
    context.stroke();
    context.fillText(name_of(mode), 4 * scale, m * row + 12 * scale);
  });
}
