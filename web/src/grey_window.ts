// The range of optical depths that is displayed (host/xraycast/base/image.hpp).
import { clamp } from "./vectors";

/** Grey is 0 at `dark` and 1 at `light` of exp(-tau / scale), then raised to 1 / gamma, and inverted where asked for. */
export interface GreyWindow {
  scale: number;
  dark: number;
  light: number;
  gamma: number;
  inverted: boolean;
}

/** The value of a sorted list that `share` of the values do not exceed. */
const quantile = (sorted: Float32Array, share: number): number => sorted[Math.floor(share * (sorted.length - 1))]!;

/** From slightly below a picture's darkest to its lightest value, on a scale of twice the depth of its denser parts. */
export function automatic_window(tau: Float32Array): GreyWindow {
  const kMatter = 0.05, kHeadroom = 1.15;
  const sorted = tau.slice().sort();
  let first = 0;
  while (first < sorted.length && sorted[first]! <= kMatter) ++first;
  const matter = sorted.subarray(first), typical = matter.length > 0 ? quantile(matter, 0.9) : kMatter;
  const scale = 2 * typical, light = Math.exp(-quantile(sorted, 0.001) / scale);
  return { scale, dark: Math.min(Math.exp((-kHeadroom * quantile(sorted, 0.999)) / scale), 0.8 * light), light, gamma: 1, inverted: false };
}

/** Dragging across changes the window's width, down its level. */
export function dragged(window: GreyWindow, across: number, down: number): GreyWindow {
  const middle = 0.5 * (window.dark + window.light) + 0.001 * down;
  const half = Math.max(0.01, 0.5 * (window.light - window.dark) * Math.exp(0.005 * across));
  const dark = clamp(middle - half, 0, 0.98);
  return { ...window, dark, light: clamp(middle + half, dark + 0.02, 1) };
}
