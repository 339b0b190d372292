// Triangle meshes: normals for shading, and the tube that a catheter is drawn as.
import type { Mesh } from "./data";
import { Vec3, add, cross, dot, length, minus, normalized, times } from "./vectors";

/** The area-weighted mean of the triangles' normals at every point. */
export function normals_of({ points_mm: p, triangles }: Mesh): Float32Array {
  const normals = new Float32Array(p.length);
  for (let t = 0; t < triangles.length; t += 3) {
    const a = 3 * triangles[t]!, b = 3 * triangles[t + 1]!, c = 3 * triangles[t + 2]!;
    const ux = p[b]! - p[a]!, uy = p[b + 1]! - p[a + 1]!, uz = p[b + 2]! - p[a + 2]!;
    const vx = p[c]! - p[a]!, vy = p[c + 1]! - p[a + 1]!, vz = p[c + 2]! - p[a + 2]!;
    const nx = uy * vz - uz * vy, ny = uz * vx - ux * vz, nz = ux * vy - uy * vx;
    for (const corner of [a, b, c]) {
      normals[corner] = normals[corner]! + nx;
      normals[corner + 1] = normals[corner + 1]! + ny;
      normals[corner + 2] = normals[corner + 2]! + nz;
    }
  }
  return normals;
}

/** The same with the points of each cell of a grid moved into their middle, without the triangles that this flattens. A closed
 * mesh stays closed. */
export function clustered({ points_mm: p, triangles }: Mesh, cell_mm: number): Mesh {
  const cells = new Map<string, number>(), cell_of = new Uint32Array(p.length / 3), sums: number[] = [], kept: number[] = [];
  for (let i = 0; i < cell_of.length; ++i) {
    const at = [0, 1, 2].map((axis) => p[3 * i + axis]!), key = at.map((x) => Math.floor(x / cell_mm)).join();
    const cell = cells.get(key) ?? cells.size;
    if (cell === cells.size) sums.push(0, 0, 0, 0);
    cells.set(key, cell);
    cell_of[i] = cell;
    [...at, 1].forEach((x, k) => (sums[4 * cell + k]! += x));
  }
  for (let t = 0; t < triangles.length; t += 3) {
    const [a, b, c] = [cell_of[triangles[t]!]!, cell_of[triangles[t + 1]!]!, cell_of[triangles[t + 2]!]!];
    if (a !== b && b !== c && c !== a) kept.push(a, b, c);
  }
  const points = Float32Array.from({ length: 3 * cells.size }, (_, i) => sums[4 * Math.floor(i / 3) + (i % 3)]! / sums[4 * Math.floor(i / 3) + 3]!);
  return { points_mm: points, triangles: Uint32Array.from(kept) };
}

/** Of surfaces in pictures of a motion, where that is less than two pixels. */
export const kCluster_mm = 2;

/** The same mesh in clusters; itself where it has so few corners that it is drawn as soon. */
export function in_clusters(mesh: Mesh): Mesh {
  const kFew = 3 * 20_000;
  return mesh.triangles.length < kFew ? mesh : clustered(mesh, kCluster_mm);
}

/** Points of the clamped cubic B-spline with these control points, `per_point` for each of them. */
export function curve_points(controls: readonly Vec3[], per_point: number): Vec3[] {
  const spans = controls.length - 3, count = per_point * controls.length, points: Vec3[] = [];
  const knot = (i: number) => Math.min(1, Math.max(0, (i - 3) / spans));
  for (let i = 0; i <= count; ++i) {
    const t = i / count, span = Math.min(spans - 1, Math.floor(t * spans)) + 3;
    // De Boor's algorithm.
    const d = [0, 1, 2, 3].map((j) => controls[span - 3 + j]!);
    for (let r = 1; r <= 3; ++r)
      for (let j = 3; j >= r; --j) {
        const low = knot(span - 3 + j), high = knot(span + 1 + j - r), share = high > low ? (t - low) / (high - low) : 0;
        d[j] = add(times(1 - share, d[j - 1]!), times(share, d[j]!));
      }
    const point = d[3]!, last = points[points.length - 1];
    if (!last || length(minus(point, last)) > 1e-6) points.push(point);
  }
  return points;
}

function any_perpendicular(v: Vec3): Vec3 {
  const [x, y, z] = [Math.abs(v[0]), Math.abs(v[1]), Math.abs(v[2])];
  return normalized(cross(v, x <= y && x <= z ? [1, 0, 0] : y <= z ? [0, 1, 0] : [0, 0, 1]));
}

/** `v`, turned by the smallest rotation that takes the unit vector `from` to `to`. */
function transported(v: Vec3, from: Vec3, to: Vec3): Vec3 {
  const axis = cross(from, to), cosine = dot(from, to);
  if (cosine < -1 + 1e-9) return v;
  const turned = cross(axis, v);
  return add(add(v, turned), times(1 / (1 + cosine), cross(axis, turned)));
}

/** The cross-sections of a line of two points or more. */
interface Section {
  at: Vec3;
  tangent: Vec3;
  normal: Vec3;
}

function sections_of(points: readonly Vec3[]): Section[] {
  const directions = points.slice(1).map((p, k) => normalized(minus(p, points[k]!)));
  let tangent = directions[0]!, normal = any_perpendicular(tangent);
  return points.map((at, k) => {
    const before = directions[Math.max(0, k - 1)]!, after = directions[Math.min(k, directions.length - 1)]!;
    const sum = add(before, after), next = length(sum) > 1e-6 ? normalized(sum) : after;
    normal = transported(normal, tangent, next);
    normal = normalized(minus(normal, times(dot(normal, next), next)));
    tangent = next;
    return { at, tangent, normal };
  });
}

function ring_of({ at, tangent, normal }: Section, radius_mm: number, sides: number): number[] {
  const binormal = cross(tangent, normal), points: number[] = [];
  for (let i = 0; i < sides; ++i) {
    const angle = (2 * Math.PI * i) / sides;
    points.push(...add(at, times(radius_mm, add(times(Math.cos(angle), normal), times(Math.sin(angle), binormal)))));
  }
  return points;
}

/** A tube around a line of two points or more, with a cone of one radius at either end. `radius_mm`: one, or one a point. */
export function tube(points: readonly Vec3[], radius_mm: number | readonly number[], sides: number): Mesh {
  const radius_at = (k: number) => (typeof radius_mm === "number" ? radius_mm : radius_mm[k]!);
  const sections = sections_of(points), first = sections[0]!, last = sections[sections.length - 1]!, triangles: number[] = [];
  const at = [...minus(first.at, times(radius_at(0), first.tangent))];
  sections.forEach((section, k) => at.push(...ring_of(section, radius_at(k), sides)));
  at.push(...add(last.at, times(radius_at(points.length - 1), last.tangent)));
  const last_pole = at.length / 3 - 1, last_ring = last_pole - sides;
  for (let i = 0; i < sides; ++i) {
    const next = (i + 1) % sides;
    triangles.push(0, 1 + next, 1 + i);
    for (let below = 1; below < last_ring; below += sides) {
      const above = below + sides;
      triangles.push(below + i, below + next, above + next, below + i, above + next, above + i);
    }
    triangles.push(last_pole, last_ring + i, last_ring + next);
  }
  return { points_mm: Float32Array.from(at), triangles: Uint32Array.from(triangles) };
}

/** A marker's band: the wall between two radii about a line, with flat ends. Its points are a tube's, but no triangle has its poles. */
export function band(points: readonly Vec3[], radius_mm: number, inner_radius_mm: number, sides: number): Mesh {
  const sections = sections_of(points), rings = 2 * sections.length, at = [...points[0]!], triangles: number[] = [];
  for (const section of sections) at.push(...ring_of(section, radius_mm, sides));
  for (const section of [...sections].reverse()) at.push(...ring_of(section, inner_radius_mm, sides));
  at.push(...points[0]!);
  for (let ring = 0; ring < rings; ++ring)
    for (let i = 0; i < sides; ++i) {
      const next = (i + 1) % sides, below = 1 + ring * sides, above = 1 + ((ring + 1) % rings) * sides;
      triangles.push(below + i, below + next, above + next, below + i, above + next, above + i);
    }
  return { points_mm: Float32Array.from(at), triangles: Uint32Array.from(triangles) };
}
