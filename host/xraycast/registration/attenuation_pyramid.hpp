#pragma once

#include "xraycast/attenuation/opacity.hpp"
#include "xraycast/base/progress.hpp"
#include "xraycast/opencl/resident_scan.hpp"
#include "xraycast/volume/volume.hpp"

#include <glm/vec3.hpp>

#include <functional>
#include <span>
#include <vector>

namespace xraycast {

/// A scan's attenuation on a device, from coarse voxels to fine ones. Voxels hold mu as Opacity::paper() maps
/// their numbers to it, so that means of voxels are means of mu; what attenuates nothing around the body is
/// cut off.
class AttenuationPyramid {
 public:
  /// Voxels averaged to about each of the spacings, coarse to fine; a spacing below the scan's own takes its
  /// voxels. With a mask, one byte a voxel, all else is air. Throws InputError when nothing attenuates, and
  /// DeviceError when the device has not enough memory.
  AttenuationPyramid(ComputeDevice& device, const Volume& scan, const Opacity& opacity,
                     std::span<const std::uint8_t> mask, std::span<const double> spacings_mm,
                     Progress& progress);

  const ResidentScan& level(std::size_t index) const { return levels_[index]; }
  std::size_t levels() const { return levels_.size(); }

  /// Of the voxels that attenuate.
  glm::dvec3 lower_mm() const { return lower_mm_; }
  glm::dvec3 upper_mm() const { return upper_mm_; }
  glm::dvec3 middle_mm() const { return 0.5 * (lower_mm_ + upper_mm_); }

 private:
  std::vector<ResidentScan> levels_;
  glm::dvec3 lower_mm_{0}, upper_mm_{0};
};

}  // namespace xraycast
