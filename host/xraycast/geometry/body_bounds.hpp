#pragma once

namespace xraycast {

/// Limits on radii and coordinates in mm, beyond any body and instrument: a file with larger values is in
/// another unit, or damaged.
inline constexpr double kLargestRadius_mm = 1000, kFarthest_mm = 10000;

}  // namespace xraycast
