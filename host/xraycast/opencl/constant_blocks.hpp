#pragma once

#include "xraycast/attenuation/opacity.hpp"
#include "xraycast/opencl/compute_device.hpp"

#include <optional>

namespace xraycast {

class ResidentScan;

/// The blocks of a scan in bricks in which an opacity gives one mu (XrcBlock of kernels/params.h), which a
/// projection adds as mu times length.
class ConstantBlocks {
 public:
  /// An XrcBlock for each block, those above each other one after the other; none where so few have one mu
  /// that skipping them saves less than looking them up takes. The first call reads the scan once; the last
  /// opacity's blocks are kept. Not thread-safe. Throws DeviceError.
  std::optional<cl::Buffer> under(const Opacity& opacity, const ResidentScan& scan);

 private:
  cl::Buffer ranges_;  ///< the least and the largest CT number of every block, two 16-bit integers each
  std::optional<Opacity> opacity_;
  std::optional<cl::Buffer> blocks_;
};

}  // namespace xraycast
