// How places of the body move, such as the corners of its vessels: displacements at the nodes of a grid about them, at some
// phases of each mode (viewer/xraycast/export/packed_lattice.hpp), trilinear between nodes, and splines over the phases.
import { ModeHeader, phase_weights } from "./motion_mode";
import { Numbers } from "./numbers";

export interface LatticeHeader {
  origin_mm: [number, number, number];
  spacing_mm: number;
  size: [number, number, number]; // nodes along x, y and z, not all of which are there
  nodes: number;
  unit_mm: number; // of the displacements
  phases: number[][]; // of each mode
}

/** Of points: their cells' nodes, eight each, and their shares of them. */
interface Places {
  nodes: Uint32Array;
  shares: Float32Array;
}

export class Lattice {
  /** `ways`: of each key, of three axes, of each node, in units; the last mode's phases vary fastest. `numbers`: of the nodes. */
  constructor(private readonly header: LatticeHeader, private readonly modes: readonly ModeHeader[], private readonly numbers: ReadonlyMap<number, number>,
    private readonly ways: Int16Array) {}

  /** At an instant, one phase a mode: of three axes, of each node, in mm. */
  displacement_mm(phases: readonly number[]): Float32Array {
    let keys = [{ key: 0, weight: 1 }];
    this.header.phases.forEach((of_mode, m) => {
      const { wraps } = this.modes[m]!, given = phases[m] ?? 0, weights = phase_weights(of_mode, wraps, wraps ? given - Math.floor(given) : given);
      keys = keys.flatMap(({ key, weight }) => weights.flatMap((share, k) => (share === 0 ? [] : [{ key: key * of_mode.length + k, weight: weight * share }])));
    });
    const count = 3 * this.header.nodes, sum = new Float32Array(count);
    for (const { key, weight } of keys) {
      const way = this.ways.subarray(key * count, (key + 1) * count), factor = weight * this.header.unit_mm;
      for (let i = 0; i < count; ++i) sum[i] = sum[i]! + factor * way[i]!;
    }
    return sum;
  }

  places_of(points_mm: Float32Array): Places {
    const { origin_mm, spacing_mm, size } = this.header, count = points_mm.length / 3;
    const nodes = new Uint32Array(8 * count), shares = new Float32Array(8 * count);
    for (let i = 0; i < count; ++i) {
      const at = [0, 1, 2].map((axis) => (points_mm[3 * i + axis]! - origin_mm[axis]!) / spacing_mm);
      const cell = at.map((x, axis) => Math.min(size[axis]! - 2, Math.max(0, Math.floor(x))));
      for (let corner = 0; corner < 8; ++corner) {
        const step = [corner & 1, (corner >> 1) & 1, corner >> 2];
        const [x, y, z] = step.map((s, axis) => cell[axis]! + s) as [number, number, number];
        const share = step.reduce((product, s, axis) => product * (s ? at[axis]! - cell[axis]! : 1 - at[axis]! + cell[axis]!), 1);
        const node = this.numbers.get((z * size[1] + y) * size[0] + x);
        nodes[8 * i + corner] = node ?? 0;
        shares[8 * i + corner] = node === undefined ? 0 : share; // clusters of corners may lie beside the corners' cells
      }
    }
    return { nodes, shares };
  }

  /** Where points are that were `rest_mm`. */
  move(rest_mm: Float32Array, { nodes, shares }: Places, displacement_mm: Float32Array, moved_mm: Float32Array): void {
    const count = this.header.nodes;
    for (let i = 0, at = 0; i < rest_mm.length; i += 3) {
      let x = rest_mm[i]!, y = rest_mm[i + 1]!, z = rest_mm[i + 2]!;
      for (const end = at + 8; at < end; ++at) {
        const node = nodes[at]!, share = shares[at]!;
        x += share * displacement_mm[node]!;
        y += share * displacement_mm[count + node]!;
        z += share * displacement_mm[2 * count + node]!;
      }
      moved_mm[i] = x;
      moved_mm[i + 1] = y;
      moved_mm[i + 2] = z;
    }
  }
}

/** `nodes`: their numbers in the grid, x fastest, as differences. `ways`: differences from the key before, in the same order. */
export function lattice_of(header: LatticeHeader, modes: readonly ModeHeader[], nodes: Uint8Array, ways: Uint8Array): Lattice {
  const of_nodes = new Numbers(nodes), numbers = new Map<number, number>();
  for (let i = 0, number = 0; i < header.nodes; ++i) numbers.set((number += of_nodes.next()), i);
  const count = 3 * header.nodes, keys = header.phases.reduce((product, { length }) => product * length, 1), all = new Int16Array(keys * count);
  const of_ways = new Numbers(ways);
  for (let i = 0; i < all.length; ++i) all[i] = (i >= count ? all[i - count]! : 0) + of_ways.next();
  return new Lattice(header, modes, numbers, all);
}
