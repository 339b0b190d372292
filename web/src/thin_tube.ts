// An instrument that is thinner than a pixel darkens it by its share of it: it is drawn about a pixel thick, and what it absorbs
// across stays the same (viewer/xraycast/scene/thin_tube.hpp).
import type { Surface } from "./data";
import { Vec3, dot, minus } from "./vectors";
import { View, source_mm, towards_detector } from "./view";

const kLeastRadius_pixels = 0.61;

/** A surface's tube_sides, and what follows from them. */
interface Tube {
  sides: number;
  radius_mm: number;
  from_axis_mm: Float32Array; // every point from the middle of its ring, poles from themselves
  lower_mm: Vec3;
  upper_mm: Vec3;
}

/** How a tube is drawn in a view. */
export interface Widening {
  factor: number; // by which its points move away from the axis
  thinness: number; // 1 up to the least radius, 0 from twice that on
  share: number; // of the drawn tube that its matter fills
}

const tubes = new WeakMap<Surface["mesh"], Tube | null>();

/** None of a surface that is no tube. */
export function tube_of({ mesh, tube_sides }: Surface): Tube | null {
  let tube = tubes.get(mesh);
  if (tube === undefined) tubes.set(mesh, (tube = tube_sides ? measured(mesh.points_mm, tube_sides) : null));
  return tube;
}

function measured(p: Float32Array, sides: number): Tube {
  const from_axis_mm = new Float32Array(p.length);
  const lower_mm: [number, number, number] = [Infinity, Infinity, Infinity];
  const upper_mm: [number, number, number] = [-Infinity, -Infinity, -Infinity];
  let radius_mm = 0;
  for (let ring = 1; 3 * (ring + sides) < p.length; ring += sides) {
    const first = 3 * ring, end = 3 * (ring + sides);
    for (let axis = 0; axis < 3; ++axis) {
      let sum = 0;
      for (let i = first + axis; i < end; i += 3) sum += p[i]!;
      for (let i = first + axis; i < end; i += 3) from_axis_mm[i] = p[i]! - sum / sides;
    }
    radius_mm = Math.max(radius_mm, Math.hypot(from_axis_mm[first]!, from_axis_mm[first + 1]!, from_axis_mm[first + 2]!));
  }
  for (let i = 0; i < p.length; ++i) {
    lower_mm[i % 3] = Math.min(lower_mm[i % 3]!, p[i]!);
    upper_mm[i % 3] = Math.max(upper_mm[i % 3]!, p[i]!);
  }
  return { sides, radius_mm, from_axis_mm, lower_mm, upper_mm };
}

/** Of a view's pixels in the plane of the corner of a tube's box that is farthest from a cone's source. */
function largest_pixel_mm(view: View, { lower_mm, upper_mm }: Tube): number {
  if (!view.cone) return view.pixel_mm;
  const n = towards_detector(view), farther = (axis: 0 | 1 | 2) => (n[axis] > 0 ? upper_mm : lower_mm)[axis];
  const farthest_mm = dot(minus([farther(0), farther(1), farther(2)], source_mm(view, view.cone)), n);
  return view.pixel_mm * Math.min(1, Math.max(0, farthest_mm) / view.cone.source_detector_mm);
}

export function widening_of(surface: Surface, view: View): Widening {
  const tube = tube_of(surface);
  if (!tube || tube.radius_mm <= 0) return { factor: 1, thinness: 0, share: 1 };
  const radii = tube.radius_mm / (kLeastRadius_pixels * largest_pixel_mm(view, tube)), factor = Math.max(1, 1 / radii);
  const thinness = Math.min(1, Math.max(0, 2 - radii));
  // The matter is a circle's and the drawn tube's section a polygon, which lacks a part of it.
  const lacks = Math.PI / (0.5 * tube.sides * Math.sin((2 * Math.PI) / tube.sides)) - 1;
  return { factor, thinness, share: (1 + lacks * thinness) / (factor * factor) };
}

/** The points of a surface as they are drawn. */
export function widened(surface: Surface, { factor }: Widening): Float32Array {
  const tube = tube_of(surface), { points_mm } = surface.mesh;
  return tube && factor > 1 ? points_mm.map((x, i) => x + (factor - 1) * tube.from_axis_mm[i]!) : points_mm;
}
