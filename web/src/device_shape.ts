// Balloons and stents as surfaces.
import type { DeviceMatter, Surface } from "./data";
import type { DeviceTube } from "./live_message";
import { band, tube } from "./mesh";
import type { Vec3 } from "./vectors";

export function device_surfaces(tubes: readonly DeviceTube[], matters: readonly DeviceMatter[]): Surface[] {
  return tubes.flatMap(({ matter, inner_radius_mm, points }): Surface[] => {
    const material = matters[matter];
    if (!material || points.length < 2) return [];
    const line = points.map(([x, y, z]): Vec3 => [x, y, z]), radii_mm = points.map(([, , , radius_mm]) => radius_mm), sides = material.tube_sides;
    const mesh = inner_radius_mm > 0 ? band(line, radii_mm[0]!, inner_radius_mm, sides) : tube(line, radii_mm, sides);
    return [{ ...material, mesh, is_closed: true }];
  });
}
