#pragma once

#include "xraycast/volume/slice_source.hpp"

#include <memory>

namespace xraycast {

/// A scan with the contrast agent removed from its vessels: every voxel of the vessels' mask (above 0)
/// becomes blood (kBloodHu), including stents and plaques in the lumen. The edge is
/// soft: voxels brighter than blood that share a face, an edge or a corner with the mask lose a half, 29 % or
/// 13 % of the difference to blood. All other voxels are unchanged. So vessels that are drawn as a surface
/// are not also in the body map.
class WithoutVessels final : public SliceSource {
 public:
  /// Throws InputError when the mask does not lie on the scan's grid.
  WithoutVessels(std::unique_ptr<SliceSource> scan, Volume mask);

  const VolumeGeometry& geometry() const override { return scan_->geometry(); }
  std::int64_t read(std::span<std::int16_t> hu, Progress& progress) override;

  /// Range of the original scan.
  HuRange hu_range() const override { return scan_->hu_range(); }

 private:
  void fill(std::int64_t z, std::span<std::int16_t> slice) const;

  std::unique_ptr<SliceSource> scan_;
  Volume mask_;
  std::int64_t next_ = 0;
};

}  // namespace xraycast
