// The hub's force and torque over the run, as a strip with a mark at the present time.
import type { Run } from "./data";
import { length_s, picture_at } from "./device_shape";

const kCurves = [{ name: "force", unit: "N", colour: "--force" }, { name: "torque", unit: "mN m", colour: "--torque" }] as const;

const values_of = (run: Run, k: number): number[] => (k === 0 ? run.force_N : run.torque_mNm);

/** What a strip shows, in words. */
export function strip_text(run: Run): string {
  const range = (k: number) => `${Math.min(...values_of(run, k)).toFixed(2)} to ${Math.max(...values_of(run, k)).toFixed(2)} ${kCurves[k]!.unit}`;
  return `At the hub of the ${run.device}: force ${range(0)}, torque ${range(1)}, over ${length_s(run).toFixed(1)} s`;
}

export function draw_strip(canvas: HTMLCanvasElement, run: Run, time_s: number): void {
  const scale = devicePixelRatio, width = Math.round(canvas.clientWidth * scale), height = Math.round(canvas.clientHeight * scale);
  if (width === 0 || height === 0) return;
  Object.assign(canvas, { width, height });
  const context = canvas.getContext("2d")!, style = getComputedStyle(canvas);
  const x_of = (picture: number) => (picture / Math.max(1, run.pictures - 1)) * (width - 1);
  context.font = `${11 * scale}px system-ui, sans-serif`;
  kCurves.forEach(({ name, unit, colour }, k) => {
    const values = values_of(run, k), low = Math.min(0, ...values), high = Math.max(1e-3, ...values);
    const y_of = (value: number) => height - 3 * scale - ((value - low) / (high - low)) * (height - 20 * scale);
    context.strokeStyle = context.fillStyle = style.getPropertyValue(colour);
    context.lineWidth = 1.5 * scale;
    context.beginPath();
    values.forEach((value, i) => context.lineTo(x_of(i), y_of(value)));
    context.stroke();
    context.textAlign = k === 0 ? "left" : "right";
    const now = values[picture_at(run, time_s)] ?? 0;
    context.fillText(`${name} ${now.toFixed(2)} ${unit}`, k === 0 ? 4 * scale : width - 4 * scale, 12 * scale);
  });
  context.fillStyle = style.color;
  context.fillRect(x_of(picture_at(run, time_s)) - 0.5 * scale, 0, scale, height);
}
