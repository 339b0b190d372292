#pragma once

namespace xraycast {

/// Lengths beyond any body and instrument, in mm: what a file says beyond them is in another unit, or
/// damaged. Radii, and coordinates.
inline constexpr double kLargestRadius_mm = 1000, kFarthest_mm = 10000;

}  // namespace xraycast
