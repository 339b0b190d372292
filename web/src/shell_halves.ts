// Splits the optical depths of shells into those of their halves (viewer/xraycast/sampling/shell_halves.hpp): mu at a shell's
// edges is the mean of the slope of a polynomial through the running sum and of Akima's.
import { clamp } from "./vectors";

/** The coefficients of the means of four adjacent cells in the slope, between the second and third, of their running sum. */
function slope_of_sum(cells_mm: readonly number[]): number[] {
  const [a, b, c, d] = cells_mm as [number, number, number, number];
  const ends = [-a - b, -b, 0, c, c + d];
  const of_ends = [0, 0, 0, 0, 0];
  for (const i of [0, 1, 3, 4]) {
    let product = 1 / ends[i]!;
    for (let j = 0; j < 5; ++j) if (j !== i && j !== 2) product *= -ends[j]! / (ends[i]! - ends[j]!);
    of_ends[i] = product;
  }
  of_ends[2] = -(of_ends[0]! + of_ends[1]! + of_ends[3]! + of_ends[4]!);
  const of_means = [0, 0, 0, 0];
  let behind = 0;
  for (let cell = 3; cell >= 0; --cell) {
    behind += of_ends[cell + 1]!;
    of_means[cell] = behind * cells_mm[cell]!;
  }
  return of_means;
}

export class ShellHalves {
  private readonly layers: number;
  private readonly texels: number;
  private readonly smooth: number[][] = [];
  private readonly per_mm: Float32Array;
  private readonly inner_mm: Float32Array;
  private readonly outer_mm: Float32Array;
  private readonly gain_mm: Float32Array;
  private readonly means: Float32Array;

  /** Of K >= 2 shells, and texels whose rays end at these radii. */
  constructor(edges_mm: readonly number[], reaches_mm: Float32Array) {
    const layers = (this.layers = edges_mm.length - 1), texels = (this.texels = reaches_mm.length);
    const thickness = (k: number) => {
      const shell = clamp(k, 0, layers - 1);
      return edges_mm[shell + 1]! - edges_mm[shell]!;
    };
    for (let edge = 0; edge <= layers; ++edge)
      this.smooth.push(slope_of_sum([thickness(edge - 2), thickness(edge - 1), thickness(edge), thickness(edge + 1)]));
    this.per_mm = new Float32Array(layers * texels);
    this.inner_mm = new Float32Array(layers * texels);
    this.outer_mm = new Float32Array(layers * texels);
    this.gain_mm = new Float32Array(layers * texels);
    this.means = new Float32Array((layers + 4) * texels);
    for (let k = 0; k < layers; ++k) {
      const inner = edges_mm[k]!, middle = 0.5 * (inner + edges_mm[k + 1]!);
      for (let i = 0; i < texels; ++i) {
        const outer = clamp(reaches_mm[i]!, inner, edges_mm[k + 1]!), extent = outer - inner, at = k * texels + i;
        const in_inner = Math.min(outer, middle) - inner, in_outer = extent - in_inner;
        this.per_mm[at] = extent > 0 ? 1 / extent : 0;
        this.inner_mm[at] = in_inner;
        this.outer_mm[at] = in_outer;
        this.gain_mm[at] = extent > 0 ? (in_inner * in_outer) / (2 * extent) : 0;
      }
    }
  }

  /** From `shells`, K x texels, to `halves`, 2 K x texels. */
  halve(shells: Float32Array, halves: Float32Array): void {
    const { layers, texels, means } = this;
    // Two ghost shells on either side: linear towards the axis, constant beyond a ray's end.
    for (let k = 0; k < layers; ++k)
      for (let i = 0; i < texels; ++i) {
        const at = k * texels + i, to = at + 2 * texels;
        means[to] = this.per_mm[at]! > 0 ? shells[at]! * this.per_mm[at]! : k > 0 ? means[to - texels]! : shells[at]!;
      }
    for (let i = 0; i < texels; ++i) {
      const here = means[2 * texels + i]!, fall = here - means[3 * texels + i]!, last = means[(layers + 1) * texels + i]!;
      means[texels + i] = here + fall;
      means[i] = here + 2 * fall;
      means[(layers + 2) * texels + i] = means[(layers + 3) * texels + i] = last;
    }
    for (let i = 0; i < texels; ++i) {
      let at_inner = this.at_edge(0, i);
      for (let k = 0; k < layers; ++k) {
        const at_outer = this.at_edge(k + 1, i), at = k * texels + i;
        const mu = means[at + 2 * texels]!, gain = this.gain_mm[at]! * (at_outer - at_inner);
        halves[2 * k * texels + i] = this.inner_mm[at]! * mu - gain;
        halves[(2 * k + 1) * texels + i] = this.outer_mm[at]! * mu + gain;
        at_inner = at_outer;
      }
    }
  }

  private at_edge(edge: number, i: number): number {
    const even = 1e-7; // per mm: where mu is flat on both sides, both count alike
    const c = this.smooth[edge]!, n = this.texels, first = edge * n + i, m = this.means;
    const m0 = m[first]!, m1 = m[first + n]!, m2 = m[first + 2 * n]!, m3 = m[first + 3 * n]!;
    const change_behind = Math.abs(m3 - m2) + even, change_before = Math.abs(m1 - m0) + even;
    const akima = (change_behind * m1 + change_before * m2) / (change_behind + change_before);
    return 0.5 * (akima + c[0]! * m0 + c[1]! * m1 + c[2]! * m2 + c[3]! * m3);
  }
}
