#pragma once

#include "xraycast/mask/mask.hpp"

#include <cstdint>
#include <vector>

namespace xraycast {

/// The connected components of a mask, run-length encoded along x, so that memory is small also on large
/// grids.
class Components {
 public:
  /// Labels the components by 26-connectivity: voxels that share a face, an edge or a corner.
  explicit Components(const Mask& mask);

  struct Run {
    std::int64_t first;  ///< offset of its first voxel
    std::int32_t length;
    std::int32_t component;  ///< 0 to count() - 1
  };
  const std::vector<Run>& runs() const { return runs_; }
  int count() const { return static_cast<int>(voxels_.size()); }

  /// Number of voxels of a component.
  std::int64_t voxels(int component) const { return voxels_[static_cast<std::size_t>(component)]; }

  /// The component with the most voxels; -1 without any.
  int largest() const;

  /// The component that a voxel belongs to, or -1.
  int at(const Index3& index) const;

  /// Keeps the components for which `keep[component]` is set.
  Mask select(const std::vector<bool>& keep) const;

 private:
  VolumeGeometry geometry_;
  std::vector<Run> runs_;
  std::vector<std::size_t> row_ends_;  ///< where the runs of each row end
  std::vector<std::int64_t> voxels_;
};

/// A mask without the components of less than a hundredth of the largest one's voxels.
Mask without_small_components(const Mask& mask);

}  // namespace xraycast
