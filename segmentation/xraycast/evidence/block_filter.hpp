#pragma once

#include "xraycast/base/progress.hpp"
#include "xraycast/opencl/compute_device.hpp"
#include "xraycast/volume/volume.hpp"

#include <functional>
#include <span>
#include <vector>

namespace xraycast {

/// A block of a scan on the device and the filters of kernels/vesselness.cl. Values are float, x fastest;
/// beyond the block its border is replicated.
class BlockFilter {
 public:
  /// Throws InputError for a block of more voxels than the kernels index, and DeviceError.
  BlockFilter(ComputeDevice& device, const Index3& size);

  std::size_t voxel_count() const { return static_cast<std::size_t>(size_.x * size_.y * size_.z); }

  cl::Buffer upload(std::span<const float> values);
  std::vector<float> download(const cl::Buffer& values);

  /// Smooths by a Gaussian of these standard deviations along x, y and z, in voxels.
  cl::Buffer smooth(const cl::Buffer& values, const glm::dvec3& sigma_vox);

  /// Raises `best` to the tubularity of values that were smoothed to `scale_mm`, where that is larger.
  void add_tubularity(const cl::Buffer& smoothed, const glm::dvec3& spacing_mm, double scale_mm,
                      double strength, bool is_frangi, const cl::Buffer& best);

  /// Ridge strength by oriented line integrals: the largest over `directions` of the weaker of a line's two
  /// arms' means, weighted by a Gaussian of `sigma_vox` over `reach_vox` voxels.
  /// It is 0 where a voxel and its neighbours are below `least`. Throws InputError where the block with a
  /// margin of `reach_vox` has more voxels than the kernels index.
  cl::Buffer ridge_strength(const cl::Buffer& values, double sigma_vox, int reach_vox, int directions,
                            double least);

 private:
  cl::Buffer block();

  /// Runs a kernel of vesselness.cl with so many work items, until the current CancelScope ends. Its first
  /// arguments are input, output and the block's size; `arguments` are the rest.
  template <typename... Arguments>
  void run(const char* name, const Index3& items, const cl::Buffer& source, const cl::Buffer& target,
           const Arguments&... arguments);
  Index3 eight_a_work_item() const;

  ComputeDevice& device_;
  Index3 size_;
};

/// Filters a whole scan slab by slab, each with `halo` additional slices on either side. Advances `progress`,
/// if given, by the finished slices. Throws InputError where a slab has too many voxels, and DeviceError.
std::vector<float> filtered(const Volume& volume, ComputeDevice& device, std::int64_t halo,
                            const std::function<cl::Buffer(BlockFilter&, const cl::Buffer&)>& filter,
                            Progress* progress = nullptr);

/// A scan smoothed by a Gaussian. Throws as filtered().
std::vector<float> smoothed(const Volume& volume, const glm::dvec3& sigma_vox, ComputeDevice& device);

}  // namespace xraycast
