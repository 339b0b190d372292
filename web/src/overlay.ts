// What lies over the picture: orientation letters, a scale bar, and the vessels' outline (viewer/xraycast/scene/annotations.hpp).
import type { Absorbed } from "./absorption";
import { Vec3, normalized, times } from "./vectors";
import type { TargetMark } from "./data";
import { View, magnification_of, right_of, shown_at, up_of } from "./view";

/** The largest of 1, 2 or 5 times a power of ten that does not exceed `limit`. */
export function round_length(limit: number): number {
  const decade = 10 ** Math.floor(Math.log10(limit));
  return ([5, 2].find((factor) => factor * decade <= limit) ?? 1) * decade;
}

/** `L`, `LA` and so on: where a direction points, but for components below 15 degrees. */
export function orientation_of(direction: Vec3): string {
  const [x, y, z] = normalized(direction);
  return ([[Math.abs(x), x > 0 ? "L" : "R"], [Math.abs(y), y > 0 ? "P" : "A"], [Math.abs(z), z > 0 ? "S" : "I"]] as const)
    .filter(([size]) => size > 0.26)
    .sort((a, b) => b[0] - a[0])
    .map(([, letter]) => letter)
    .join("");
}

const kInk = "#ffd159";

export interface Outline {
  covered: Absorbed;
  colour: readonly number[]; // 0 to 255
}

/** `scale` is that of the display's pixels; without letters and bar the vessels' outline alone. */
export function draw_overlay(canvas: HTMLCanvasElement, view: View, outline: Outline | null, scale: number, has_letters: boolean, target: TargetMark | null = null, blades_mm: readonly [number, number] | null = null): void {
  if (canvas.width !== view.width || canvas.height !== view.height) Object.assign(canvas, { width: view.width, height: view.height });
  const context = canvas.getContext("2d")!;
  context.clearRect(0, 0, canvas.width, canvas.height);
  if (outline) draw_outline(context, outline, view.height);
  if (blades_mm && has_letters) draw_blades(context, view, blades_mm, scale);
  if (target) draw_target(context, view, target, scale);
  if (has_letters) draw_letters_and_bar(context, view, scale);
}

function draw_letters_and_bar(context: CanvasRenderingContext2D, view: View, scale: number): void {
  const font = 14 * scale, margin = font / 2, { width, height } = view;
  context.font = `600 ${font}px system-ui, sans-serif`;
  context.lineJoin = "round";
  const text = (x: number, y: number, words: string, align: CanvasTextAlign) => {
    context.textAlign = align;
    context.lineWidth = 3 * scale;
    context.strokeStyle = "#000";
    context.fillStyle = kInk;
    context.strokeText(words, x, y);
    context.fillText(words, x, y);
  };
  text(margin, 0.5 * height, orientation_of(times(-1, right_of(view))), "left");
  text(width - margin, 0.5 * height, orientation_of(right_of(view)), "right");
  text(0.5 * width, margin + 0.8 * font, orientation_of(up_of(view)), "center");
  text(0.5 * width, height - margin, orientation_of(times(-1, up_of(view))), "center");
  draw_scale_bar(context, view, font, scale, text);
}

/** Where the blades' edges are, or will be in the next picture. */
function draw_blades(context: CanvasRenderingContext2D, view: View, blades_mm: readonly [number, number], scale: number): void {
  const [width, height] = blades_mm.map((mm) => (mm * magnification_of(view)) / view.pixel_mm) as [number, number];
  context.save();
  context.lineWidth = scale;
  context.strokeStyle = kInk;
  context.setLineDash([4 * scale, 4 * scale]);
  context.strokeRect(0.5 * (view.width - width), 0.5 * (view.height - height), width, height);
  context.restore();
}

/** At the picture's side, the way to what lies beyond it. */
function draw_arrow(context: CanvasRenderingContext2D, view: View, x: number, y: number, scale: number): void {
  const margin = 24 * scale, across = 0.5 * view.width, along = 0.5 * view.height, angle = Math.atan2(y - along, x - across);
  const reach = Math.min((across - margin) / Math.abs(Math.cos(angle)), (along - margin) / Math.abs(Math.sin(angle)));
  context.save();
  context.translate(across + reach * Math.cos(angle), along + reach * Math.sin(angle));
  context.rotate(angle);
  context.beginPath();
  for (const [dx, dy] of [[12, 0], [-8, -9], [-3, 0], [-8, 9]] as const) context.lineTo(dx * scale, dy * scale);
  context.closePath();
  context.lineWidth = 3 * scale;
  context.strokeStyle = "#000";
  context.stroke();
  context.fillStyle = kInk;
  context.fill();
  context.restore();
}

function draw_target(context: CanvasRenderingContext2D, view: View, { at_mm, radius_mm }: TargetMark, scale: number): void {
  const kLeast = 9, { x, y, pixels_per_mm } = shown_at(view, at_mm), radius = Math.max(kLeast * scale, radius_mm * pixels_per_mm);
  if (x < 0 || y < 0 || x > view.width || y > view.height) return draw_arrow(context, view, x, y, scale);
  context.save();
  for (const [width, colour] of [[4 * scale, "#000"], [2 * scale, kInk]] as const) {
    context.lineWidth = width;
    context.strokeStyle = colour;
    context.beginPath();
    context.arc(x, y, radius, 0, 2 * Math.PI);
    for (const [dx, dy] of [[1, 0], [-1, 0], [0, 1], [0, -1]] as const) {
      context.moveTo(x + dx * radius, y + dy * radius);
      context.lineTo(x + dx * (radius + 5 * scale), y + dy * (radius + 5 * scale));
    }
    context.stroke();
  }
  context.restore();
}

function draw_scale_bar(
  context: CanvasRenderingContext2D, view: View, font: number, scale: number,
  text: (x: number, y: number, words: string, align: CanvasTextAlign) => void,
): void {
  const at_axis_mm = view.pixel_mm / magnification_of(view), bar_mm = round_length(0.25 * view.width * at_axis_mm);
  const right = view.width - font / 2, left = right - bar_mm / at_axis_mm, y = view.height - 0.8 * font;
  for (const [width, colour] of [[4 * scale, "#000"], [2 * scale, kInk]] as const) {
    context.lineWidth = width;
    context.strokeStyle = colour;
    context.beginPath();
    context.moveTo(left, y - 4 * scale);
    context.lineTo(left, y);
    context.lineTo(right, y);
    context.lineTo(right, y - 4 * scale);
    context.stroke();
  }
  text(right, y - 0.6 * font, `${bar_mm} mm`, "right");
}

/** Pixels that vessels cover with a neighbour that they do not. */
function draw_outline(context: CanvasRenderingContext2D, { covered, colour }: Outline, picture_height: number): void {
  const { x, y, width, height, tau } = covered, rgba = [...colour, 255];
  const image = context.createImageData(width, height);
  const covers = (i: number, j: number) => i >= 0 && j >= 0 && i < width && j < height && tau[j * width + i]! > 0;
  for (let j = 0; j < height; ++j)
    for (let i = 0; i < width; ++i)
      if (covers(i, j) && !(covers(i - 1, j) && covers(i + 1, j) && covers(i, j - 1) && covers(i, j + 1)))
        image.data.set(rgba, 4 * ((height - 1 - j) * width + i));
  context.putImageData(image, x, picture_height - y - height);
}
