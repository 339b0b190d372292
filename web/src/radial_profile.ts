// mu along a radius, linear between the middles of shells of which only the integrals are known
// (viewer/xraycast/sampling/radial_profile.hpp).
import { clamp } from "./vectors";

/** The edges of all shells' halves. */
export function halved(edges_mm: readonly number[]): number[] {
  const halves = [edges_mm[0]!];
  for (let k = 0; k + 1 < edges_mm.length; ++k) halves.push(0.5 * (edges_mm[k]! + edges_mm[k + 1]!), edges_mm[k + 1]!);
  return halves;
}

export class RadialProfile {
  readonly middles_mm: number[] = [];
  readonly knots_mm: number[]; // where the slope of mu changes

  constructor(readonly edges_mm: readonly number[]) {
    for (let k = 0; k + 1 < edges_mm.length; ++k) this.middles_mm.push(0.5 * (edges_mm[k]! + edges_mm[k + 1]!));
    this.knots_mm = this.layers === 1 ? [...edges_mm] : [edges_mm[0]!, ...this.middles_mm, edges_mm[edges_mm.length - 1]!];
  }

  get layers(): number {
    return this.middles_mm.length;
  }

  /** The layer to interpolate from at a radius, plus the weight of the next one: 3.25 is a quarter of layer 4. */
  at(radius_mm: number): number {
    const middles = this.middles_mm, last = middles.length - 1;
    if (last === 0) return 0;
    let low = 0, high = last + 1; // the first middle above the radius
    while (low < high) {
      const middle = (low + high) >> 1;
      if (middles[middle]! > radius_mm) high = middle;
      else low = middle + 1;
    }
    const layer = clamp(low - 1, 0, last - 1);
    // The weight of the next layer stays below 1, so that the sum tells both.
    return layer + clamp((radius_mm - middles[layer]!) / (middles[layer + 1]! - middles[layer]!), 0, 0.9999999);
  }

  /** The mean of mu over shell k up to a ray's end: `below` of the layer before, `above` of the next, the rest its own. */
  private row(k: number, reach_mm: number): { below: number; above: number; per_mm: number } {
    const inner = this.edges_mm[k]!, outer = Math.min(this.edges_mm[k + 1]!, reach_mm), extent = outer - inner;
    if (extent <= 0) return { below: 0, above: 0, per_mm: 0 };
    const is_last = k + 1 === this.layers || this.edges_mm[k + 1]! >= reach_mm, middle = this.middles_mm[k]!;
    let below = 0, above = 0;
    if (k > 0) {
      const gap = middle - this.middles_mm[k - 1]!, inwards = Math.min(outer, middle) - inner;
      below = (((middle - (inner + 0.5 * inwards)) / gap) * inwards) / extent;
    }
    if (!is_last) {
      const outwards = outer - middle;
      above = (((0.5 * outwards) / (this.middles_mm[k + 1]! - middle)) * outwards) / extent;
    }
    return { below, above, per_mm: 1 / extent };
  }

  /** The factored equations of texels whose rays end at these radii. */
  system(reaches_mm: Float32Array): ProfileSystem {
    const texels = reaches_mm.length, size = this.layers * texels;
    const system = {
      layers: this.layers, texels, per_mm: new Float32Array(size), below: new Float32Array(size),
      upper: new Float32Array(size), pivot: new Float32Array(size),
    };
    for (let i = 0; i < texels; ++i) {
      let upper_before = 0;
      for (let k = 0; k < this.layers; ++k) {
        const { below, above, per_mm } = this.row(k, reaches_mm[i]!), at = k * texels + i;
        const pivot = 1 - below - above - below * upper_before;
        upper_before = above / pivot;
        system.per_mm[at] = per_mm;
        system.below[at] = per_mm > 0 || k === 0 ? below : -1; // beyond a ray's end as the layer before
        system.upper[at] = upper_before;
        system.pivot[at] = 1 / pivot;
      }
    }
    return system;
  }
}

/** A tridiagonal system for each texel, factored by Thomas' algorithm: layers x texels. */
export interface ProfileSystem {
  layers: number;
  texels: number;
  per_mm: Float32Array;
  below: Float32Array;
  upper: Float32Array;
  pivot: Float32Array;
}

/** Solves in place, from the integrals of shells (layers x texels) to mu in their middles. */
export function solve(system: ProfileSystem, values: Float32Array): void {
  const { layers, texels, per_mm, below, upper, pivot } = system;
  for (let at = 0; at < layers * texels; ++at) {
    const before = at >= texels ? values[at - texels]! : 0;
    values[at] = (values[at]! * per_mm[at]! - below[at]! * before) * pivot[at]!;
  }
  for (let at = (layers - 1) * texels - 1; at >= 0; --at) values[at] = values[at]! - upper[at]! * values[at + texels]!;
}
