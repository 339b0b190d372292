#pragma once

#include "xraycast/mask/mask.hpp"
#include "xraycast/volume/volume.hpp"

#include <cstdint>
#include <vector>

namespace xraycast {

/// How much of each voxel is lumen, on a scan's grid, x fastest.
struct LumenFill {
  static constexpr std::uint8_t kFull = 255;

  VolumeGeometry geometry;
  std::vector<std::uint8_t> fractions;  ///< from 0 to kFull
  bool is_of_touched_voxels =
      false;  ///< its mask holds all voxels that lumen touches, not the half full ones

  /// No lumen, on a grid.
  explicit LumenFill(const VolumeGeometry& grid)
      : geometry(grid), fractions(static_cast<std::size_t>(grid.voxel_count())) {}

  double volume_mm3() const;
};

/// A fraction from 0 to 1 as a LumenFill holds it.
std::uint8_t quantised_fraction(double fraction);

/// The fill of a mask whose wall lies where voxels are half full. Voxels in it that touch none outside are
/// full. Of those at its wall, on both sides, the CT number says how full they are, between that of the
/// tissue (the median two voxels off the mask) and that of the full voxels around (of all full voxels, where
/// none is near). Outside of the mask no voxel is more than half full: what is as bright there is bone.
LumenFill fill_of(const Volume& volume, const Mask& mask);

}  // namespace xraycast
