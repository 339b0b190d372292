// From a map's optical depths to what compositing sums: mu in the middles of the drawn shells
// (viewer/xraycast/sampling/map_texels.hpp).
import type { MapGeometry } from "./data";
import { RadialProfile, halved, solve } from "./radial_profile";
import { ShellHalves } from "./shell_halves";

/** The radii of the drawn shells: those of the map, or their halves where layers are blended. */
export const drawn_radii_mm = (map: MapGeometry): readonly number[] => (map.layers > 1 ? halved(map.radii_mm) : map.radii_mm);

/** Texels in the layout of the shaders: layers x (width + 1) columns x quads of four rows. */
export interface DrawnTexels {
  layers: number;
  columns: number;
  quads: number;
  values: Float32Array;
}

/** `tau` is K x H x W; `weights` has one per layer of the map, 0 hides it. */
export function drawn_texels(map: MapGeometry, tau: Float32Array, weights: readonly number[]): DrawnTexels {
  const { width, height, layers: shells } = map;
  const radii_mm = drawn_radii_mm(map), layers = radii_mm.length - 1, parts = layers / shells;
  const system = new RadialProfile(radii_mm).system(map.reaches_mm);
  const halves = parts === 2 ? new ShellHalves(map.radii_mm, map.reaches_mm) : null;
  const columns = width + 1, quads = Math.ceil(height / 4), run = 4 * quads;
  const values = new Float32Array(layers * columns * run);
  const row = new Float32Array(shells * width), drawn = new Float32Array(layers * width);
  for (let j = 0; j < 4 * quads; ++j) {
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
      const weight = weights[Math.floor(k / parts)] ?? 1, to = k * columns * run + j;
      for (let i = 0; i <= width; ++i) values[to + i * run] = weight * drawn[k * width + (i % width)]!;
    }
  }
  return { layers, columns, quads, values };
}
