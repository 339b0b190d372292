// What vessels and catheter absorb (viewer/xraycast/scene/absorbing_surfaces.hpp). At every point of a ray only the largest mu
// counts, so that surfaces which overlap represent their union: all entries and exits of a pixel's ray are collected and
// sorted by depth. A tube that is thinner than a pixel is drawn wider than it is: its matter displaces only its share of what is
// there.
import type { Surface } from "./data";
import { widened, widening_of } from "./thin_tube";
import { dot, length, minus } from "./vectors";
import { View, pixel_on_detector_mm, source_mm, to_clip, towards_detector } from "./view";

/** Optical depths of a part of a picture, the lowest row first; pixels are counted from the lower left corner. */
export interface Absorbed {
  x: number;
  y: number;
  width: number;
  height: number;
  tau: Float32Array;
}

/** Pixels, from the lower left corner, and depth along the beam's axis of every point. */
function projected(points: Float32Array, view: View): Float64Array {
  const m = to_clip(view), n = towards_detector(view);
  const depth_0 = -dot(n, view.cone ? source_mm(view, view.cone) : view.centre_mm);
  const result = new Float64Array(points.length);
  for (let i = 0; i < points.length; i += 3) {
    const x = points[i]!, y = points[i + 1]!, z = points[i + 2]!;
    const w = m[3]! * x + m[7]! * y + m[11]! * z + m[15]!;
    result[i] = 0.5 * ((m[0]! * x + m[4]! * y + m[8]! * z + m[12]!) / w + 1) * view.width;
    result[i + 1] = 0.5 * ((m[1]! * x + m[5]! * y + m[9]! * z + m[13]!) / w + 1) * view.height;
    result[i + 2] = n[0] * x + n[1] * y + n[2] * z + depth_0;
  }
  return result;
}

/** The crossings of all rays of a part of the picture with surfaces, as a list for every pixel. */
class Crossings {
  readonly first: Int32Array;
  depth = new Float32Array(1 << 14);
  /** Of what the ray enters there, negative where it leaves. */
  mu_per_mm = new Float32Array(1 << 14);
  share = new Float32Array(1 << 14); // of the place that it takes up
  next = new Int32Array(1 << 14);
  count = 0;

  constructor(readonly x: number, readonly y: number, readonly width: number, readonly height: number) {
    this.first = new Int32Array(width * height).fill(-1);
  }

  add(pixel: number, depth: number, mu_per_mm: number, share: number): void {
    if (this.count === this.depth.length) this.grow();
    this.depth[this.count] = depth;
    this.mu_per_mm[this.count] = mu_per_mm;
    this.share[this.count] = share;
    this.next[this.count] = this.first[pixel]!;
    this.first[pixel] = this.count++;
  }

  private grow(): void {
    const larger = <T extends Float32Array | Int32Array>(old: T, made: T): T => (made.set(old), made);
    const size = 2 * this.count;
    this.depth = larger(this.depth, new Float32Array(size));
    this.mu_per_mm = larger(this.mu_per_mm, new Float32Array(size));
    this.share = larger(this.share, new Float32Array(size));
    this.next = larger(this.next, new Int32Array(size));
  }

  /** A triangle (indices of its corners' coordinates), as two that share an edge see it alike. */
  rasterise(p: Float64Array, a: number, b: number, c: number, is_cone: boolean, mu_per_mm: number, share: number): void {
    let area = (p[b]! - p[a]!) * (p[c + 1]! - p[a + 1]!) - (p[b + 1]! - p[a + 1]!) * (p[c]! - p[a]!);
    if (area === 0 || (is_cone && Math.min(p[a + 2]!, p[b + 2]!, p[c + 2]!) < 1)) return;
    if (area < 0) {
      [b, c] = [c, b];
      area = -area;
    } else mu_per_mm = -mu_per_mm; // rays leave through faces towards the detector
    const left = Math.max(this.x, Math.ceil(Math.min(p[a]!, p[b]!, p[c]!) - 0.5));
    const right = Math.min(this.x + this.width - 1, Math.floor(Math.max(p[a]!, p[b]!, p[c]!) - 0.5));
    const bottom = Math.max(this.y, Math.ceil(Math.min(p[a + 1]!, p[b + 1]!, p[c + 1]!) - 0.5));
    const top = Math.min(this.y + this.height - 1, Math.floor(Math.max(p[a + 1]!, p[b + 1]!, p[c + 1]!) - 0.5));
    if (left > right || bottom > top) return;
    // The depth, or under a cone its reciprocal, is linear.
    const linear = (i: number) => (is_cone ? 1 / p[i + 2]! : p[i + 2]!);
    const at_a = linear(a), to_b = linear(b) - at_a, to_c = linear(c) - at_a;
    const per_x = (to_b * (p[c + 1]! - p[a + 1]!) - to_c * (p[b + 1]! - p[a + 1]!)) / area;
    const per_y = (to_c * (p[b]! - p[a]!) - to_b * (p[c]! - p[a]!)) / area;
    const low = at_a + Math.min(0, to_b, to_c), high = at_a + Math.max(0, to_b, to_c);
    for (let row = bottom; row <= top; ++row)
      for (let column = left; column <= right; ++column) {
        const x = column + 0.5, y = row + 0.5;
        if (!is_left_of(p, a, b, x, y) || !is_left_of(p, b, c, x, y) || !is_left_of(p, c, a, x, y)) continue;
        const value = Math.min(high, Math.max(low, at_a + per_x * (x - p[a]!) + per_y * (y - p[a + 1]!)));
        this.add((row - this.y) * this.width + column - this.x, is_cone ? 1 / value : value, mu_per_mm, share);
      }
  }
}

/** Whether a place is to the left of an edge, which two triangles evaluate alike. */
function is_left_of(p: Float64Array, from: number, to: number, x: number, y: number): boolean {
  const is_reversed = p[to]! < p[from]! || (p[to]! === p[from]! && p[to + 1]! < p[from + 1]!);
  const start = is_reversed ? to : from, end = is_reversed ? from : to;
  const dx = p[end]! - p[start]!, dy = p[end + 1]! - p[start + 1]!;
  return dx * (y - p[start + 1]!) >= dy * (x - p[start]!) !== is_reversed;
}

/** The part of the picture that points lie in; none where that is empty. */
function box_of(points: Float64Array[], view: View): [number, number, number, number] | null {
  let low_x = Infinity, low_y = Infinity, high_x = -Infinity, high_y = -Infinity;
  for (const p of points)
    for (let i = 0; i < p.length; i += 3) {
      if (view.cone && p[i + 2]! < 1) return [0, 0, view.width, view.height];
      low_x = Math.min(low_x, p[i]!);
      high_x = Math.max(high_x, p[i]!);
      low_y = Math.min(low_y, p[i + 1]!);
      high_y = Math.max(high_y, p[i + 1]!);
    }
  const x = Math.max(0, Math.floor(low_x)), y = Math.max(0, Math.floor(low_y));
  const right = Math.min(view.width, Math.ceil(high_x)), top = Math.min(view.height, Math.ceil(high_y));
  return x < right && y < top ? [x, y, right - x, top - y] : null;
}

/** What a ray is in, from the weakest on: of every mu, and share of its place, how often it was entered more than left. */
class Within {
  private readonly matter: { mu: number; share: number; winding: number }[] = [];

  clear(): void {
    this.matter.length = 0;
  }

  /** The mu beyond a crossing: the largest, where the matter takes up its place whole. */
  cross(entered: number, share: number): number {
    const { matter } = this, mu = Math.abs(entered);
    let place = matter.findIndex((m) => m.mu === mu && m.share === share);
    if (place < 0) {
      place = matter.findIndex((m) => m.mu >= mu);
      if (place < 0) place = matter.length;
      matter.splice(place, 0, { mu, share, winding: 0 });
    }
    matter[place]!.winding += Math.sign(entered);
    if (matter[place]!.winding === 0) matter.splice(place, 1);
    let sum = 0;
    for (const m of matter) if (m.winding > 0) sum = m.share === 1 ? m.mu : sum + m.share * (m.mu - sum);
    return sum;
  }
}

/** The optical depth of one pixel: at every depth the largest mu of the surfaces that the ray is within. */
function tau_of(crossings: Crossings, pixel: number, order: number[], within: Within): number {
  order.length = 0;
  for (let i = crossings.first[pixel]!; i >= 0; i = crossings.next[i]!) {
    let place = order.length++;
    for (; place > 0 && crossings.depth[order[place - 1]!]! > crossings.depth[i]!; --place) order[place] = order[place - 1]!;
    order[place] = i;
  }
  within.clear();
  let sum = 0, strongest = 0, before = 0;
  for (const i of order) {
    const depth = crossings.depth[i]!;
    sum += strongest * (depth - before);
    before = depth;
    strongest = within.cross(crossings.mu_per_mm[i]!, crossings.share[i]!);
  }
  return sum;
}

/** The pixels that a surface covers, whatever it holds. */
export const covered_by = (surface: Surface, view: View): Absorbed | null => absorbed_by([{ mesh: surface.mesh, is_closed: true, colour: surface.colour, mu_per_mm: 1 }], view);

/** What surfaces absorb in a view; none where nothing is seen of them. */
export function absorbed_by(surfaces: readonly Surface[], view: View): Absorbed | null {
  const widenings = surfaces.map((surface) => widening_of(surface, view));
  const points = surfaces.map((surface, i) => projected(widened(surface, widenings[i]!), view)), box = box_of(points, view);
  if (!box) return null;
  const [x, y, width, height] = box, crossings = new Crossings(x, y, width, height);
  surfaces.forEach(({ mesh: { triangles }, mu_per_mm, weights }, number) => {
    const p = points[number]!, { share } = widenings[number]!;
    for (let t = 0; t < triangles.length; t += 3) {
      const mu = weights ? mu_per_mm * weights[triangles[t]!]! : mu_per_mm;
      if (mu > 0) crossings.rasterise(p, 3 * triangles[t]!, 3 * triangles[t + 1]!, 3 * triangles[t + 2]!, view.cone !== null, mu, share);
    }
  });
  const tau = new Float32Array(width * height), order: number[] = [], within = new Within();
  for (let pixel = 0; pixel < tau.length; ++pixel) {
    if (crossings.first[pixel]! < 0) continue;
    tau[pixel] = tau_of(crossings, pixel, order, within);
    if (!view.cone) continue;
    // A ray is longer than its part along the beam's axis.
    const on_detector = pixel_on_detector_mm(view, x + (pixel % width), view.height - 1 - y - Math.floor(pixel / width));
    tau[pixel] = (tau[pixel]! * length(minus(on_detector, source_mm(view, view.cone)))) / view.cone.source_detector_mm;
  }
  return { x, y, width, height, tau };
}
