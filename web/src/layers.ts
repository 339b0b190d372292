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

/** `tau` is K x H x W. One band after the other, which takes little memory; `values` are overwritten by the next. */
export function* drawn_bands(map: MapGeometry, tau: Float32Array, quads_per_band = 16): Generator<DrawnBand> {
  const { width, height, layers: shells } = map;
  const radii_mm = drawn_radii_mm(map), layers = radii_mm.length - 1, parts = layers / shells;
  const system = new RadialProfile(radii_mm).system(map.reaches_mm);
  const halves = parts === 2 ? new ShellHalves(map.radii_mm, map.reaches_mm) : null;
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
          // Along rays that an outline shortens, mu is solved for over the lengths of the longest.
          for (let i = 0; i < width; ++i) row[k * width + i] = tau[from + i]! / map.scales[i]!;
        }
        if (halves) halves.halve(row, drawn);
        else drawn.set(row);
        solve(system, drawn);
      } // rows beyond the last one repeat it
      for (let k = 0; k < layers; ++k) {
        const to = k * columns * run + in_band;
        for (let i = 0; i <= width; ++i) values[to + i * run] = drawn[k * width + (i % width)]!;
      }
    }
    yield { first_quad, quads, values };
  }
}

/** The same map with half the rows, each the mean of two, for pictures that are too coarse to show them. */
export function with_half_the_rows(map: MapGeometry, tau: Float32Array): { map: MapGeometry; tau: Float32Array } {
  const height = Math.ceil(map.height / 2), halved_tau = new Float32Array(map.layers * height * map.width);
  for (let k = 0, to = 0; k < map.layers; ++k)
    for (let j = 0; j < height; ++j) {
      const upper = (k * map.height + 2 * j) * map.width, lower = 2 * j + 1 < map.height ? upper + map.width : upper;
      for (let i = 0; i < map.width; ++i) halved_tau[to++] = 0.5 * (tau[upper + i]! + tau[lower + i]!);
    }
  return { map: { ...map, height, row_mm: 2 * map.row_mm, top_mm: map.top_mm - 0.5 * map.row_mm }, tau: halved_tau };
}
