#include "xraycast/segmentation/vesselness.hpp"

#include "xraycast/base/parallel.hpp"
#include "xraycast/evidence/block_filter.hpp"

#include <algorithm>
#include <cmath>

namespace xraycast {
namespace {

/// The maximum over the scales.
cl::Buffer vesselness_of(BlockFilter& block, const cl::Buffer& hu, const glm::dvec3& spacing_mm,
                         const VesselnessOptions& options) {
  const std::vector<float> zeros(block.voxel_count(), 0.0F);
  cl::Buffer best = block.upload(zeros);
  const bool is_frangi = options.measure == VesselnessMeasure::frangi;
  // The second derivative across a tube, times the scale squared, is about 0.4 of its contrast at best.
  const double tube = 0.4 * options.contrast_hu;
  for (const double scale_mm : options.scales_mm) {
    block.add_tubularity(block.smooth(hu, scale_mm / spacing_mm), spacing_mm, scale_mm, 0.5 * tube, is_frangi,
                         best);
  }
  return best;
}

}  // namespace

std::vector<float> vesselness(std::span<const float> hu, const VolumeGeometry& grid,
                              const VesselnessOptions& options, ComputeDevice& device) {
  BlockFilter block(device, grid.size);
  return block.download(vesselness_of(block, block.upload(hu), grid.spacing_mm, options));
}

std::vector<float> vesselness(const Volume& volume, const VesselnessOptions& options, ComputeDevice& device,
                              Progress& progress) {
  const CancelScope scope(progress);
  const VolumeGeometry& g = volume.geometry();
  progress.begin("vesselness", g.size.z, "slices");
  // A Gaussian reaches three standard deviations, the second difference a slice more.
  const double widest_mm = std::ranges::max(options.scales_mm);
  const auto halo = static_cast<std::int64_t>(std::ceil(3 * widest_mm / g.spacing_mm.z)) + 1;
  return filtered(
      volume, device, halo,
      [&](BlockFilter& block, const cl::Buffer& hu) {
        return vesselness_of(block, hu, g.spacing_mm, options);
      },
      &progress);
}

}  // namespace xraycast
