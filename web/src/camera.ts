// The pose of C-arm and table, within the limits of the viewer.
import { clamp } from "./vectors";
import { Bounds, Cone, View, fitting_pixel_mm, wrapped_degrees } from "./view";

export interface Camera {
  lao_deg: number;
  cranial_deg: number;
  zoom: number; // 1: the whole body fits
  table_mm: number; // the picture's centre above mid-height
}

export interface CameraLimits {
  least_zoom: number;
  most_zoom: number;
  most_tilt_deg: number;
}

/** Within the limits of a C-arm and the body; the same object where it is within them. */
export function limited(camera: Camera, bounds: Bounds, limits: CameraLimits): Camera {
  const within: Camera = {
    lao_deg: wrapped_degrees(camera.lao_deg),
    cranial_deg: clamp(camera.cranial_deg, -limits.most_tilt_deg, limits.most_tilt_deg),
    zoom: clamp(camera.zoom, limits.least_zoom, limits.most_zoom),
    table_mm: clamp(camera.table_mm, -bounds.half_height_mm, bounds.half_height_mm),
  };
  const is_same = (Object.keys(within) as (keyof Camera)[]).every((field) => within[field] === camera[field]);
  return is_same ? camera : within;
}

/** What fits at zoom 1: the picture that is not tilted, so that tilting does not zoom, as in the viewer and in `render --session`;
 * or the tilted one, as in `render --tilt`. */
export type Fit = "untilted" | "tilted";

/** The camera's view of a body. */
export function view_of(camera: Camera, cone: Cone | null, bounds: Bounds, width: number, height: number, fit: Fit): View {
  const [x, y, z] = bounds.centre_mm;
  const view = {
    angle_rad: (camera.lao_deg * Math.PI) / 180, tilt_rad: (camera.cranial_deg * Math.PI) / 180, cone,
    centre_mm: [x, y, z] as const, width, height,
  };
  const fitted = fit === "tilted" ? view : { ...view, tilt_rad: 0 };
  const pixel_mm = fitting_pixel_mm(fitted, bounds) / camera.zoom;
  return { ...view, centre_mm: [x, y, z + camera.table_mm], pixel_mm };
}
