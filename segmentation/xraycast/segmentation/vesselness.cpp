#include "xraycast/segmentation/vesselness.hpp"

#include "xraycast/segmentation/block_filter.hpp"

#include <algorithm>

namespace xraycast {

std::vector<float> vesselness(std::span<const float> hu, const VolumeGeometry& grid,
                              const VesselnessOptions& options, ComputeDevice& device) {
  BlockFilter block(device, grid.size);
  const cl::Buffer values = block.upload(hu);
  const std::vector<float> nothing(hu.size(), 0.0F);
  const cl::Buffer best = block.upload(nothing);
  const bool is_frangi = options.measure == VesselnessMeasure::frangi;
  // The second derivative across a tube, times the scale squared, is about 0.4 of its contrast at best.
  const double tube = 0.4 * options.contrast_hu;
  for (const double scale_mm : options.scales_mm)
    block.add_tubularity(block.smooth(values, scale_mm / grid.spacing_mm), grid.spacing_mm, scale_mm,
                         0.5 * tube, is_frangi, best);
  return block.download(best);
}

}  // namespace xraycast
