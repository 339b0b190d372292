// The pose of C-arm and table, within the limits of the viewer.
import { clamp } from "./vectors";
import { Bounds, Cone, View, fitting_pixel_mm, wrapped_degrees } from "./view";

export interface CArmPose {
  lao_deg: number;
  cranial_deg: number;
  zoom: number; // 1: the whole body fits
  table_mm: number; // the picture's centre above mid-height
  left_mm: number; // and beside the map's axis, on the patient's left
  back_mm: number; // and behind it
}

export interface PoseLimits {
  least_zoom: number;
  most_zoom: number;
  most_tilt_deg: number;
}

/** Within the limits of a C-arm and the body; the same object where it is within them. */
export function limited(pose: CArmPose, bounds: Bounds, limits: PoseLimits): CArmPose {
  const within: CArmPose = {
    lao_deg: wrapped_degrees(pose.lao_deg),
    cranial_deg: clamp(pose.cranial_deg, -limits.most_tilt_deg, limits.most_tilt_deg),
    zoom: clamp(pose.zoom, limits.least_zoom, limits.most_zoom),
    table_mm: clamp(pose.table_mm, -bounds.half_height_mm, bounds.half_height_mm),
    left_mm: clamp(pose.left_mm, -bounds.radius_mm, bounds.radius_mm),
    back_mm: clamp(pose.back_mm, -bounds.radius_mm, bounds.radius_mm),
  };
  const is_same = (Object.keys(within) as (keyof CArmPose)[]).every((field) => within[field] === pose[field]);
  return is_same ? pose : within;
}

/** What fits at zoom 1: the picture that is not tilted, so that tilting does not zoom, as in the viewer and in `render --session`;
 * or the tilted one, as in `render --tilt`. */
export type Fit = "untilted" | "tilted";

/** The pose's view of a body. */
export function view_of(pose: CArmPose, cone: Cone | null, bounds: Bounds, width: number, height: number, fit: Fit): View {
  const [x, y, z] = bounds.centre_mm;
  const view = {
    lao_rad: (pose.lao_deg * Math.PI) / 180, cranial_rad: (pose.cranial_deg * Math.PI) / 180, cone,
    centre_mm: [x, y, z] as const, width, height,
  };
  const fitted = fit === "tilted" ? view : { ...view, cranial_rad: 0 };
  const pixel_mm = fitting_pixel_mm(fitted, bounds) / pose.zoom;
  return { ...view, centre_mm: [x + pose.left_mm, y + pose.back_mm, z + pose.table_mm], pixel_mm };
}
