// Vessels filled unevenly with contrast agent (viewer/xraycast/scene/contrast_surface.hpp).
import type { Contrast, Surface } from "./data";
import type { FilledDrum } from "./live_message";
import type { Lattice } from "./moving_lattice";
import type { Vec3 } from "./vectors";

/** How a body that moves takes the drums along, by their middles. */
export class MovingDrums {
  private readonly middles_mm: Float32Array;
  private readonly places: ReturnType<Lattice["places_of"]>;

  constructor({ drum_points, mesh: { points_mm } }: Contrast, private readonly lattice: Lattice) {
    this.middles_mm = new Float32Array(points_mm.length / drum_points);
    for (let i = 0; i < points_mm.length; ++i) this.middles_mm[3 * Math.floor(i / 3 / drum_points) + (i % 3)]! += points_mm[i]! / drum_points;
    this.places = lattice.places_of(this.middles_mm);
  }

  /** The same drums at an instant, one phase a mode. */
  moved(drums: readonly FilledDrum[], phases: readonly number[]): FilledDrum[] {
    if (drums.length === 0) return [];
    const moved_mm = new Float32Array(this.middles_mm.length);
    this.lattice.move(this.middles_mm, this.places, this.lattice.displacement_mm(phases), moved_mm);
    const way_mm = (drum: number) => [0, 1, 2].map((axis) => (moved_mm[3 * drum + axis] ?? 0) - (this.middles_mm[3 * drum + axis] ?? 0)) as unknown as Vec3;
    return drums.map((one) => ({ ...one, moved_mm: way_mm(one.drum) }));
  }
}

/** A drum's end, whose points are its outline and its middle, to a radius; 0 leaves it as it is. */
function widen(points_mm: Float32Array, first: number, count: number, radius_mm: number): void {
  const middle = 3 * (first + count - 1), at = (axis: number) => points_mm[middle + axis]!;
  const before_mm = Math.hypot(points_mm[3 * first]! - at(0), points_mm[3 * first + 1]! - at(1), points_mm[3 * first + 2]! - at(2));
  const factor = radius_mm / before_mm, kRounded_mm = 0.02; // the mesh's coordinates are hundredths
  if (!(radius_mm > 0) || Math.abs(radius_mm - before_mm) < kRounded_mm) return;
  for (let i = 3 * first; i < middle; ++i) points_mm[i] = at(i % 3) + factor * (points_mm[i]! - at(i % 3));
}

/** The drums that hold some, each with its own attenuation; none where none does. */
export function filled(whole: Contrast, drums: readonly FilledDrum[]): Surface | null {
  const { drum_points, drum_triangles, mesh } = whole, count = mesh.points_mm.length / 3 / drum_points;
  const known = drums.filter(({ drum }) => drum < count);
  if (known.length === 0) return null;
  const points_mm = new Float32Array(3 * drum_points * known.length), weights = new Float32Array(drum_points * known.length);
  const triangles = new Uint32Array(3 * drum_triangles * known.length);
  known.forEach(({ drum, mg_ml, ends_mm, moved_mm }, i) => {
    const first = drum_points * drum, moved = drum_points * i - first;
    points_mm.set(mesh.points_mm.subarray(3 * first, 3 * (first + drum_points)), 3 * drum_points * i);
    for (const end of [0, 1] as const) widen(points_mm, drum_points * i + (end * drum_points) / 2, drum_points / 2, ends_mm[end]);
    if (moved_mm) for (let at = 3 * drum_points * i; at < 3 * drum_points * (i + 1); ++at) points_mm[at]! += moved_mm[at % 3]!;
    weights.fill(mg_ml, drum_points * i, drum_points * (i + 1));
    for (let corner = 0; corner < 3 * drum_triangles; ++corner)
      triangles[3 * drum_triangles * i + corner] = mesh.triangles[3 * drum_triangles * drum + corner]! + moved;
  });
  return { mesh: { points_mm, triangles }, weights, is_closed: true, mu_per_mm: whole.mu_per_mm, colour: whole.colour };
}
