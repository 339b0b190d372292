// A C-arm and its detector, as `xraycast render` has them (host/xraycast/projection/view.hpp).
import { Vec3, add, cross, dot, minus, times } from "./vectors";

export interface Cone {
  source_axis_mm: number;
  source_detector_mm: number;
}

/** The upright cylinder that bounds a map's body. */
export interface Bounds {
  centre_mm: Vec3;
  radius_mm: number;
  half_height_mm: number;
  finest_mm: number; // the map's resolution, in whole multiples of which a picture's height fits
}

export interface View {
  lao_rad: number; // LAO is positive
  cranial_rad: number; // cranial is positive
  cone: Cone | null; // none: a parallel beam
  centre_mm: Vec3; // what the picture's centre shows
  width: number;
  height: number; // pixels
  pixel_mm: number; // on the detector
}

export const towards_detector = (v: View): Vec3 => [
  Math.sin(v.lao_rad) * Math.cos(v.cranial_rad),
  -Math.cos(v.lao_rad) * Math.cos(v.cranial_rad),
  Math.sin(v.cranial_rad),
];
export const right_of = (v: View): Vec3 => [Math.cos(v.lao_rad), Math.sin(v.lao_rad), 0];
export const up_of = (v: View): Vec3 => cross(towards_detector(v), right_of(v));

/** The source of a cone. */
export const source_mm = (v: View, cone: Cone): Vec3 =>
  minus(v.centre_mm, times(cone.source_axis_mm, towards_detector(v)));

/** Of what lies at the height of the view's centre. */
export const magnification_of = ({ cone }: View): number => (cone ? cone.source_detector_mm / cone.source_axis_mm : 1);

/** The middle of pixel (i, j), row 0 on top: on the detector of a cone, else in the plane through the centre. */
export function pixel_on_detector_mm(v: View, i: number, j: number): Vec3 {
  const beyond_mm = v.cone ? v.cone.source_detector_mm - v.cone.source_axis_mm : 0;
  const across = times((i + 0.5 - 0.5 * v.width) * v.pixel_mm, right_of(v));
  const upwards = times((0.5 * v.height - j - 0.5) * v.pixel_mm, up_of(v));
  return add(add(add(v.centre_mm, times(beyond_mm, towards_detector(v))), across), upwards);
}

/** Where a point is shown, in pixels from the upper left corner, and the pixels of a millimetre there. */
export function shown_at(v: View, point_mm: Vec3): { x: number; y: number; pixels_per_mm: number } {
  const away = minus(point_mm, v.centre_mm), { cone } = v;
  const pixels_per_mm = (cone ? cone.source_detector_mm / (cone.source_axis_mm + dot(away, towards_detector(v))) : 1) / v.pixel_mm;
  return { x: 0.5 * v.width + dot(away, right_of(v)) * pixels_per_mm, y: 0.5 * v.height - dot(away, up_of(v)) * pixels_per_mm, pixels_per_mm };
}

/** The pixel size with which the body's circle and its whole height fit (viewer/xraycast/sampling/pose.cpp, `fitted`). */
export function fitting_pixel_mm(v: Omit<View, "pixel_mm">, bounds: Bounds): number {
  const half_height_mm = 0.5 * bounds.finest_mm * Math.max(1, Math.ceil((2 * bounds.half_height_mm) / bounds.finest_mm - 1e-6));
  const ct = Math.abs(Math.cos(v.cranial_rad)), st = Math.abs(Math.sin(v.cranial_rad));
  let magnification = 1;
  if (v.cone) {
    const nearest_mm = v.cone.source_axis_mm - (bounds.radius_mm * ct + half_height_mm * st);
    magnification = v.cone.source_detector_mm / Math.max(nearest_mm, 0.1 * v.cone.source_axis_mm);
  }
  const width_mm = 2 * bounds.radius_mm * magnification;
  const height_mm = 2 * (half_height_mm * ct + bounds.radius_mm * st) * magnification;
  return Math.max(width_mm / v.width, height_mm / v.height, Math.max(width_mm, height_mm) / 4096);
}

/** A 4 x 4 matrix, column by column, from LPS millimetres to clip space; nearer to the detector is in front. */
export function to_clip(v: View): Float64Array {
  const right = times(2 / (v.width * v.pixel_mm), right_of(v)), up = times(2 / (v.height * v.pixel_mm), up_of(v));
  const n = towards_detector(v), origin = v.cone ? source_mm(v, v.cone) : v.centre_mm;
  let rows: [Vec3, number][];
  if (v.cone) {
    const nearest_mm = 0.05 * v.cone.source_axis_mm, farthest_mm = v.cone.source_axis_mm + 3000;
    const b = 2 / (1 / nearest_mm - 1 / farthest_mm), a = -1 - b / farthest_mm, enlarged = v.cone.source_detector_mm;
    const ahead_mm = -dot(n, origin);
    rows = [[times(enlarged, right), -enlarged * dot(right, origin)], [times(enlarged, up), -enlarged * dot(up, origin)],
      [times(a, n), a * ahead_mm + b], [n, ahead_mm]];
  } else {
    const reach_mm = 3000;
    rows = [[right, -dot(right, origin)], [up, -dot(up, origin)], [times(-1 / reach_mm, n), dot(n, origin) / reach_mm],
      [[0, 0, 0], 1]];
  }
  const matrix = new Float64Array(16);
  rows.forEach(([along, constant], i) => {
    for (let axis = 0; axis < 3; ++axis) matrix[4 * axis + i] = along[axis]!;
    matrix[12 + i] = constant;
  });
  return matrix;
}

/** `LAO 30 / CRA 10`, as a C-arm displays its angles. */
export function label_of(lao_rad: number, cranial_rad: number): string {
  const degrees = 180 / Math.PI, angle = wrapped_degrees(lao_rad * degrees), tilt = cranial_rad * degrees;
  const shown = (x: number) => String(Math.round(Math.abs(x) * 10) / 10);
  let text = Math.abs(angle) < 0.05 ? "AP" : `${angle > 0 ? "LAO" : "RAO"} ${shown(angle)}`;
  if (Math.abs(tilt) >= 0.05) text += ` / ${tilt > 0 ? "CRA" : "CAU"} ${shown(tilt)}`;
  return text;
}

/** The same angle within half a turn of 0. */
export function wrapped_degrees(x: number): number {
  const within = x % 360; // exact, however large x is
  return within - 360 * Math.round(within / 360);
}
