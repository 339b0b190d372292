// The pose of C-arm and table, and its limits, as in the viewer (viewer/xraycast/sampling/camera.hpp).
import { clamp } from "./vectors";
import { Bounds, Cone, View, fitting_pixel_mm, wrapped_degrees } from "./view";

export interface Camera {
  lao_deg: number;
  cranial_deg: number;
  zoom: number; // 1: the whole body fits
  table_mm: number; // the picture's centre above mid-height
}

export const kPresets: readonly { name: string; lao_deg: number }[] = [
  { name: "AP", lao_deg: 0 }, { name: "LAO 45", lao_deg: 45 }, { name: "RAO 30", lao_deg: -30 }, { name: "Lateral", lao_deg: 90 },
];

const kMinZoom = 0.25, kMaxZoom = 40, kMaxTilt_deg = 50;

/** Within the limits of a C-arm and the body. */
export function limited(camera: Camera, bounds: Bounds): Camera {
  return {
    lao_deg: wrapped_degrees(camera.lao_deg),
    cranial_deg: clamp(camera.cranial_deg, -kMaxTilt_deg, kMaxTilt_deg),
    zoom: clamp(camera.zoom, kMinZoom, kMaxZoom),
    table_mm: clamp(camera.table_mm, -bounds.half_height_mm, bounds.half_height_mm),
  };
}

/** The camera's view of a body; at zoom 1 all of it fits, as `xraycast render` frames it. */
export function view_of(camera: Camera, cone: Cone | null, bounds: Bounds, width: number, height: number): View {
  const [x, y, z] = bounds.centre_mm;
  const view = {
    angle_rad: (camera.lao_deg * Math.PI) / 180, tilt_rad: (camera.cranial_deg * Math.PI) / 180, cone,
    centre_mm: [x, y, z] as const, width, height,
  };
  const pixel_mm = fitting_pixel_mm(view, bounds) / camera.zoom;
  return { ...view, centre_mm: [x, y, z + camera.table_mm], pixel_mm };
}
