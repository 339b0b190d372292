// A view's rays resampled onto the upright plane through its centre, where all rays of a column sample the map at the same
// places (viewer/xraycast/sampling/rectified_view.hpp). Rows of the plane are counted downwards, columns from the left;
// s is a ray's horizontal distance in mm from the plane, positive towards the detector.
import type { MapGeometry } from "./data";
import { Vec2, Vec3, dot, minus } from "./vectors";
import { View, pixel_on_detector_mm, right_of, source_mm, up_of } from "./view";

export interface Rectified {
  centre_mm: Vec2;
  right: Vec2;
  forward: Vec2; // towards the detector
  source_mm: number; // horizontal distance of a cone's source; 0: a parallel beam
  source_z_mm: number;
  slope: number; // rise over run of a parallel beam
  columns: number;
  rows: number;
  left_mm: number;
  column_mm: number;
  top_mm: number;
  row_mm: number;
  from_pixel: number[]; // 3 x 3, column by column: pixels, from the upper left corner, to column and row
}

/** A range of numbers. */
class Range {
  low = Infinity;
  high = -Infinity;
  include(x: number): void {
    this.low = Math.min(this.low, x);
    this.high = Math.max(this.high, x);
  }
  intersect(low: number, high: number): void {
    this.low = Math.max(this.low, low);
    this.high = Math.min(this.high, high);
  }
}

/** From pixels (a, b, 1) to homogeneous (x, z, w) on the plane. */
type Homography = [Vec3, Vec3, Vec3];

function at(h: Homography, a: number, b: number): Vec2 {
  const p = [0, 1, 2].map((i) => h[2][i]! + a * h[0][i]! + b * h[1][i]!);
  return [p[0]! / p[2]!, p[1]! / p[2]!];
}

function homography_of(view: View, plane: Rectified): Homography {
  const image_of = (a: number, b: number): Vec3 => {
    const on_detector = pixel_on_detector_mm(view, a - 0.5, b - 0.5);
    const right: Vec3 = [...plane.right, 0], forward: Vec3 = [...plane.forward, 0];
    if (!view.cone) {
      const offset = minus(on_detector, view.centre_mm);
      return [dot(offset, right), view.centre_mm[2] + dot(offset, up_of(view)) / Math.cos(view.cranial_rad), 1];
    }
    const ray = minus(on_detector, source_mm(view, view.cone)), ahead = dot(ray, forward);
    return [plane.source_mm * dot(ray, right), plane.source_z_mm * ahead + plane.source_mm * ray[2], ahead];
  };
  const origin = image_of(0, 0);
  return [minus(image_of(1, 0), origin), minus(image_of(0, 1), origin), origin];
}

/** The part of the plane, along its rows, to which the body's circle is projected. */
function body_columns_mm(plane: Rectified, map: MapGeometry): Vec2 {
  const offset: Vec2 = [map.bounds.centre_mm[0] - plane.centre_mm[0], map.bounds.centre_mm[1] - plane.centre_mm[1]];
  const along = (d: Vec2) => offset[0] * d[0] + offset[1] * d[1];
  const across = along(plane.right), radius_mm = map.bounds.radius_mm;
  if (plane.source_mm === 0) return [across - radius_mm, across + radius_mm];
  const ahead = plane.source_mm + along(plane.forward), distance = Math.hypot(across, ahead);
  if (distance <= radius_mm) return [-Infinity, Infinity];
  const middle = Math.atan2(across, ahead), half = Math.asin(radius_mm / distance);
  const edge = (angle: number, beyond: number) =>
    Math.abs(angle) < 0.49 * Math.PI ? plane.source_mm * Math.tan(angle) : beyond;
  return [edge(middle - half, -Infinity), edge(middle + half, Infinity)];
}

/** The heights at which rays that meet the body cross the plane. */
function body_rows_mm(plane: Rectified, map: MapGeometry): Vec2 {
  const { centre_mm, radius_mm, half_height_mm } = map.bounds;
  const ahead = (centre_mm[0] - plane.centre_mm[0]) * plane.forward[0] + (centre_mm[1] - plane.centre_mm[1]) * plane.forward[1];
  const range = new Range();
  for (const side of [-1, 1])
    for (const end of [-1, 1]) {
      const s = ahead + side * radius_mm, z = centre_mm[2] + end * half_height_mm;
      const run = plane.source_mm + s;
      if (plane.source_mm === 0) range.include(z - s * plane.slope);
      else if (run > 0.02 * plane.source_mm)
        range.include(plane.source_z_mm + ((z - plane.source_z_mm) * plane.source_mm) / run);
      else return [-Infinity, Infinity];
    }
  return [range.low, range.high];
}

/** The rectified picture of a map in a view, with a column every so many pixels. */
export function rectified_view(view: View, map: MapGeometry, pixels_per_column: number): Rectified {
  const plane: Rectified = {
    centre_mm: [view.centre_mm[0], view.centre_mm[1]],
    right: [right_of(view)[0], right_of(view)[1]],
    forward: [Math.sin(view.lao_rad), -Math.cos(view.lao_rad)],
    source_mm: view.cone ? view.cone.source_axis_mm * Math.cos(view.cranial_rad) : 0,
    source_z_mm: view.cone ? source_mm(view, view.cone)[2] : 0,
    slope: view.cone ? 0 : Math.tan(view.cranial_rad),
    columns: 0, rows: 0, left_mm: 0, column_mm: 1, top_mm: 0, row_mm: 1, from_pixel: [],
  };
  const h = homography_of(view, plane);
  const x_mm = new Range(), z_mm = new Range();
  for (const a of [0, view.width])
    for (const b of [0, view.height]) {
      const corner = at(h, a, b);
      x_mm.include(corner[0]);
      z_mm.include(corner[1]);
    }
  x_mm.intersect(...body_columns_mm(plane, map));
  z_mm.intersect(...body_rows_mm(plane, map));
  const middle = at(h, 0.5 * view.width, 0.5 * view.height);
  const pixel_x_mm = at(h, 0.5 * view.width + 1, 0.5 * view.height)[0] - middle[0];
  const pixel_z_mm = Math.abs(middle[1] - at(h, 0.5 * view.width, 0.5 * view.height + 1)[1]);
  const is_upright = !view.cone && plane.slope === 0;
  // Where pixels lie between columns, full resolution takes twice as many.
  const apart = !is_upright && pixels_per_column === 1 ? 0.5 : pixels_per_column;

  plane.column_mm = pixel_x_mm * apart;
  const phase = middle[0] + (view.width % 2 === 0 ? 0.5 : 0) * pixel_x_mm;
  const first = Math.floor((x_mm.low - phase) / plane.column_mm), last = Math.ceil((x_mm.high - phase) / plane.column_mm);
  plane.left_mm = phase + first * plane.column_mm;
  const is_seen = x_mm.low < x_mm.high && z_mm.low <= z_mm.high;
  if (is_seen) plane.columns = Math.max(0, last - first + 1);

  if (is_upright) {
    plane.row_mm = map.row_mm;
    z_mm.intersect(map.top_mm - (map.height - 1) * map.row_mm, map.top_mm);
    const first_row = Math.max(0, Math.floor((map.top_mm - z_mm.high) / plane.row_mm));
    plane.top_mm = map.top_mm - 4 * Math.floor(first_row / 4) * map.row_mm;
  } else {
    const off_axis_mm = Math.hypot(plane.centre_mm[0] - map.bounds.centre_mm[0], plane.centre_mm[1] - map.bounds.centre_mm[1]);
    const spread = view.cone ? 1 + (map.bounds.radius_mm + off_axis_mm) / plane.source_mm : 1;
    plane.row_mm = Math.min(map.row_mm / spread, apart * pixel_z_mm);
    plane.top_mm = z_mm.high;
  }
  if (is_seen) plane.rows = Math.max(0, Math.ceil((plane.top_mm - z_mm.low) / plane.row_mm - 1e-9) + 1);
  // From (x, z, w) on the plane to (column, row, w).
  for (const [x, z, w] of h)
    plane.from_pixel.push((x - plane.left_mm * w) / plane.column_mm, (plane.top_mm * w - z) / plane.row_mm, w);
  return plane;
}
