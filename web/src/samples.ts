// Where the rays of a rectified view's columns sample the map: two-point Gauss-Legendre quadrature between the radii at which
// the slope of mu changes (viewer/xraycast/sampling/column_samples.hpp).
import type { MapGeometry } from "./data";
import { drawn_radii_mm } from "./layers";
import { OutlinedLine } from "./outline_crossings";
import { RadialProfile } from "./radial_profile";
import type { Rectified } from "./rectified";

const kTurn = 2 * Math.PI;
const kLayer = 2048; // of a sample's place, which is a column of the map and a layer: below 2^24, whole as a float

/** As the shaders read them, four numbers to a texel. */
export interface ColumnSamples {
  /**
   * Of each column, those of one band of the map's rows behind those of the other: its first sample, their number, and
   * 1 / the distance of a cone's source, or 0.
   */
  columns: Float32Array;
  /** Two texels each: place, weight, fraction of the next column and of the next layer; s, from, to. */
  samples: Float32Array;
}

/** One column's rays, seen from above: at foot + along * direction, from the axis. */
interface Line {
  x: number;
  y: number;
  dx: number;
  dy: number;
  offset: number;
  foot_s: number;
}

export class Sampler {
  private readonly profile: RadialProfile;
  private readonly bands: (Float64Array | null)[]; // their scales, of every column and the first again; none: circles
  private samples = new Float32Array(1 << 16);
  private count = 0;
  private texels_per_step = 3;
  private weights: readonly number[] = []; // of the drawn shells

  constructor(private readonly map: MapGeometry) {
    this.profile = new RadialProfile(drawn_radii_mm(map));
    this.bands = map.bands.map((_, band) => {
      const scales = map.scales.subarray(band * map.width, (band + 1) * map.width);
      return map.has_outline ? Float64Array.from([...scales, scales[0]!]) : null;
    });
  }

  /** One per layer of the map, 0 hides it; none: 1 everywhere. */
  set_weights(weights: readonly number[]): void {
    const parts = (drawn_radii_mm(this.map).length - 1) / this.map.layers;
    this.weights = weights.flatMap((weight) => Array<number>(parts).fill(weight));
  }

  /** A two-point quadrature spans so many texel columns at most. */
  samples_of(rectified: Rectified, texels_per_step: number): ColumnSamples {
    this.texels_per_step = texels_per_step;
    const columns = new Float32Array(4 * rectified.columns * this.bands.length);
    this.count = 0;
    this.bands.forEach((scales, band) => {
      for (let i = 0; i < rectified.columns; ++i) {
        const first = this.count, x_mm = rectified.left_mm + i * rectified.column_mm;
        this.sample(this.line_of(rectified, x_mm), scales);
        const run_mm = Math.hypot(rectified.source_mm, x_mm);
        columns.set([first, this.count - first, rectified.source_mm > 0 ? 1 / run_mm : 0], 4 * (band * rectified.columns + i));
      }
    });
    return { columns, samples: this.samples.subarray(0, 8 * this.count) };
  }

  private line_of(r: Rectified, x_mm: number): Line {
    let [dx, dy] = r.forward as [number, number];
    if (r.source_mm > 0) {
      const run = Math.hypot(r.source_mm, x_mm);
      dx = (r.source_mm * r.forward[0] + x_mm * r.right[0]) / run;
      dy = (r.source_mm * r.forward[1] + x_mm * r.right[1]) / run;
    }
    const fx = r.centre_mm[0] + x_mm * r.right[0] - this.map.centre_mm[0];
    const fy = r.centre_mm[1] + x_mm * r.right[1] - this.map.centre_mm[1];
    const foot_s = -(fx * dx + fy * dy), x = fx + foot_s * dx, y = fy + foot_s * dy;
    return { x, y, dx, dy, offset: Math.hypot(x, y), foot_s };
  }

  private sample(line: Line, scales: Float64Array | null): void {
    const [low, high] = this.within_field(line), knots = this.profile.knots_mm;
    if (!scales) {
      const radius = (along: number) => Math.hypot(along, line.offset);
      const half = (r: number) => (r > line.offset ? Math.sqrt((r - line.offset) * (r + line.offset)) : 0);
      const halves = knots.map(half);
      for (let k = knots.length - 2; k >= 0; --k)
        if (halves[k + 1]! > halves[k]!) this.sample_piece(line, -halves[k + 1]!, -halves[k]!, low, high, radius);
      for (let k = 0; k + 1 < knots.length; ++k)
        if (halves[k + 1]! > halves[k]!) this.sample_piece(line, halves[k]!, halves[k + 1]!, low, high, radius);
      return;
    }
    const across = new OutlinedLine(scales, line.x, line.y, line.dx, line.dy);
    const radius = (along: number) => across.shell_radius_mm(along);
    const crossings = across.crossings_mm(knots);
    for (let i = 0; i + 1 < crossings.length; ++i) {
      const middle = radius(0.5 * (crossings[i]! + crossings[i + 1]!));
      if (middle > knots[0]! && middle < knots[knots.length - 1]!)
        this.sample_piece(line, crossings[i]!, crossings[i + 1]!, low, high, radius);
    }
  }

  /** The interval of a line within the scan's field of view. */
  private within_field(line: Line): [number, number] {
    let low = -Infinity, high = Infinity;
    if (!this.map.field_mm) return [low, high];
    for (const axis of [0, 1] as const) {
      const start = this.map.centre_mm[axis] + (axis === 0 ? line.x : line.y), slope = axis === 0 ? line.dx : line.dy;
      const a = this.map.field_mm[0][axis] - start, b = this.map.field_mm[1][axis] - start;
      if (slope === 0) {
        if (a > 0 || b < 0) return [0, 0];
        continue;
      }
      low = Math.max(low, Math.min(a / slope, b / slope));
      high = Math.min(high, Math.max(a / slope, b / slope));
    }
    return [low, high];
  }

  private sample_piece(line: Line, from: number, to: number, low: number, high: number, radius: (along: number) => number): void {
    from = Math.max(from, low);
    to = Math.min(to, high);
    if (from >= to) return;
    const turned = Math.abs(Math.atan2(to, line.offset) - Math.atan2(from, line.offset));
    const texels = (turned / kTurn) * this.map.width;
    if (texels <= 0.5 * this.texels_per_step) {
      const middle = 0.5 * (from + to);
      return this.add(line, middle, from, to, to - from, radius(middle));
    }
    const steps = Math.ceil(texels / this.texels_per_step), step = (to - from) / steps, gauss = (0.5 * step) / Math.sqrt(3);
    for (let i = 0; i < steps; ++i) {
      const middle = from + (i + 0.5) * step;
      for (const side of [-1, 1]) {
        const along = middle + side * gauss, end = middle + side * 0.5 * step;
        this.add(line, along, Math.min(middle, end), Math.max(middle, end), 0.5 * step, radius(along));
      }
    }
  }

  private add(line: Line, along: number, from: number, to: number, weight: number, radius_mm: number): void {
    if (8 * (this.count + 1) > this.samples.length) {
      const larger = new Float32Array(2 * this.samples.length);
      larger.set(this.samples);
      this.samples = larger;
    }
    const x = line.x + along * line.dx, y = line.y + along * line.dy;
    let column = (Math.atan2(x, -y) / kTurn) * this.map.width - 0.5;
    if (column < 0) column += this.map.width;
    const first = Math.floor(column), place = this.profile.at(radius_mm), layer = Math.floor(place);
    // Between two layers of different weights: (1 - f) w0 and f w1 are the shares of a sample w' at f'.
    const here = (1 - place + layer) * (this.weights[layer] ?? 1), next = (place - layer) * (this.weights[layer + 1] ?? 1);
    if (here + next === 0) return;
    const at = 8 * this.count++, s = this.samples;
    s[at] = first + kLayer * layer;
    s[at + 1] = weight * (here + next);
    s[at + 2] = column - first;
    s[at + 3] = next / (here + next);
    s[at + 4] = line.foot_s + along;
    s[at + 5] = line.foot_s + from;
    s[at + 6] = line.foot_s + to;
  }
}
