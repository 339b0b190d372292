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

/** The depth beyond which pixels show metal, of sorted depths of a body; Infinity without any (host/xraycast/base/metal_depth.hpp). */
export function metal_from(sorted: Float32Array): number {
  const kBins = 1024, kPerDepth = 20, kRise = 30, kLeast = 0.001, kMost = 0.25, kStays = 0.45, kEdges = 0.5;
  const above = new Float64Array(kBins + kRise);
  for (const depth of sorted) ++above[Math.floor(clamp(depth * kPerDepth, 0, kBins - 1))]!;
  for (let bin = kBins - 1; bin-- > 0;) above[bin]! += above[bin + 1]!;
  let most = kStays, rise = kBins;
  for (let bin = 0; bin < kBins; ++bin) {
    const here = above[bin]!, higher = above[bin + kRise]!;
    if (here > kMost * above[0]! || higher <= kLeast * above[0]! || higher <= most * here) continue;
    [most, rise] = [higher / here, bin];
  }
  if (rise === kBins) return Infinity;
  const with_edges = above[rise]! / kEdges;
  while (rise > 0 && above[rise - 1]! <= with_edges) --rise;
  return rise / kPerDepth;
}

/** From slightly below a picture's darkest to its lightest value, or that of the body alone, on a scale of twice the depth of its denser parts; metal is left out. */
export function automatic_window(tau: Float32Array, is_of_body = false): GreyWindow {
  const kMatter = 0.05, kHeadroom = 1.15, kLightest = 0.1;
  const first_above = (depths: Float32Array, least: number): number => {
    const found = depths.findIndex((depth) => depth > least);
    return found < 0 ? depths.length : found;
  };
  const whole = tau.slice().sort(), sorted = whole.subarray(0, first_above(whole, metal_from(whole.subarray(first_above(whole, kMatter)))));
  const first = first_above(sorted, kMatter);
  const matter = sorted.subarray(first), typical = matter.length > 0 ? quantile(matter, 0.9) : kMatter;
  const scale = 2 * typical, light = Math.exp(-(is_of_body && matter.length > 0 ? quantile(matter, kLightest) : quantile(sorted, 0.001)) / scale);
  return { scale, dark: Math.min(Math.exp((-kHeadroom * quantile(sorted, 0.999)) / scale), 0.8 * light), light, gamma: 1, inverted: false };
}

/** Dragging across changes the window's width, down its level. */
export function dragged(window: GreyWindow, across: number, down: number): GreyWindow {
  const middle = 0.5 * (window.dark + window.light) + 0.001 * down;
  const half = Math.max(0.01, 0.5 * (window.light - window.dark) * Math.exp(0.005 * across));
  const dark = clamp(middle - half, 0, 0.98);
  return { ...window, dark, light: clamp(middle + half, dark + 0.02, 1) };
}
