#pragma once

#include "xraycast/attenuation/opacity.hpp"
#include "xraycast/base/progress.hpp"
#include "xraycast/casting/body_map.hpp"
#include "xraycast/casting/device_field.hpp"
#include "xraycast/casting/map_geometry.hpp"
#include "xraycast/opencl/resident_scan.hpp"

namespace xraycast {

/// A map and the time that casting took.
struct CastResult {
  BodyMap map;
  double kernel_ms = 0;  ///< wall time of the kernels on the device
};

/// Casts rays outwards through a resident scan and sums mu(HU) * length along them, layer by layer (equations
/// 1 and 2 of the X-ray casting paper). Samples lie in the middle of steps of `geometry.step_mm` and are
/// interpolated bilinearly within the slice, then classified; a sample that straddles a shell's edge is split
/// by length. Rays that leave the slice see air (-1024 HU). Stage "casting" of `progress`.
///
/// With `moved` the rays pass through the scan while it is displaced, trilinear between its voxels, and only
/// these rows are cast; what the others hold is undefined.
///
/// Throws InputError when the geometry does not match the scan or, with `moved`, is a rectangle's;
/// DeviceError when the device fails.
CastResult cast(const ResidentScan& scan, const MapGeometry& geometry, const Opacity& opacity,
                Progress& progress, const MovedRows* moved = nullptr);

}  // namespace xraycast
