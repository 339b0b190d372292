// From a map's optical depths to what compositing sums: mu in the middles of the drawn shells
// (viewer/xraycast/sampling/map_texels.hpp).
import type { MapGeometry } from "./data";
import { RadialProfile, halved, solve } from "./radial_profile";
import { ShellHalves } from "./shell_halves";

/** The radii of the drawn shells: those of the map, or their halves where layers are blended. */
export const drawn_radii_mm = (map: MapGeometry): readonly number[] => (map.layers > 1 ? halved(map.radii_mm) : map.radii_mm);

/** A band of texels in the layout of the shaders: layers x (width + 1) columns x quads of four rows. */
export interface DrawnBand {
  first_quad: number;
  quads: number;
  values: Float32Array;
}

/** The texels' numbers. */
export const texel_sizes = (map: MapGeometry) =>
  ({ layers: drawn_radii_mm(map).length - 1, columns: map.width + 1, quads: Math.ceil(map.height / 4) });

/** The number of the band of rows that a row lies in. */
function outline_of(map: MapGeometry, row: number): number {
  let band = 0;
  while (band + 1 < map.bands.length && map.bands[band + 1]! <= row) ++band;
  return band;
}

/** What solves for mu in a band of rows that share an outline. */
class BandSolver {
  private readonly system;
  private readonly halves: ShellHalves | null;
  private readonly scales: Float32Array;

  constructor(map: MapGeometry, band: number) {
    const radii_mm = drawn_radii_mm(map), reaches_mm = map.reaches_mm.subarray(band * map.width, (band + 1) * map.width);
    this.system = new RadialProfile(radii_mm).system(reaches_mm);
    this.halves = radii_mm.length === map.radii_mm.length ? null : new ShellHalves(map.radii_mm, reaches_mm);
    this.scales = map.scales.subarray(band * map.width, (band + 1) * map.width);
  }

  /** `row` is K x W, and overwritten; `drawn` the same of the drawn shells. */
  solve(row: Float32Array, drawn: Float32Array): void {
    const width = this.scales.length;
    // Along rays that an outline shortens, mu is solved for over the lengths of the longest.
    for (let i = 0; i < row.length; ++i) row[i] = row[i]! / this.scales[i % width]!;
    if (this.halves) this.halves.halve(row, drawn);
    else drawn.set(row);
    solve(this.system, drawn);
  }
}

/** `tau` is K x H x W. One band after the other, which takes little memory; `values` are overwritten by the next. */
export function* drawn_bands(map: MapGeometry, tau: Float32Array, quads_per_band = 16): Generator<DrawnBand> {
  const { width, height, layers: shells } = map;
  const layers = drawn_radii_mm(map).length - 1;
  const solvers = map.bands.map((_, band) => new BandSolver(map, band));
  const { columns, quads: all_quads } = texel_sizes(map);
  const row = new Float32Array(shells * width), drawn = new Float32Array(layers * width);
  let values = new Float32Array(0);
  for (let first_quad = 0; first_quad < all_quads; first_quad += quads_per_band) {
    const quads = Math.min(quads_per_band, all_quads - first_quad), run = 4 * quads;
    if (values.length !== layers * columns * run) values = new Float32Array(layers * columns * run);
    for (let in_band = 0; in_band < run; ++in_band) {
      const j = 4 * first_quad + in_band;
      if (j < height) {
        for (let k = 0; k < shells; ++k) {
          const from = (k * height + j) * width;
          row.set(tau.subarray(from, from + width), k * width);
        }
        solvers[outline_of(map, j)]!.solve(row, drawn);
      } // rows beyond the last one repeat it
      for (let k = 0; k < layers; ++k) {
        const to = k * columns * run + in_band;
        for (let i = 0; i <= width; ++i) values[to + i * run] = drawn[k * width + (i % width)]!;
      }
    }
    yield { first_quad, quads, values };
  }
}
