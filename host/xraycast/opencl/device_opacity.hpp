#pragma once

#include "xraycast/attenuation/opacity.hpp"
#include "xraycast/kernels/params.h"
#include "xraycast/opencl/compute_device.hpp"

#include <string>

namespace xraycast {

/// An opacity in the form that kernels/classify.h evaluates. With up to four changes of slope (`paper` has
/// one, `bilinear` two) it is a sum of ramps, exact and without memory traffic; with more it is a table with
/// an entry for every whole HU, linear between, hence exact for knots on whole HU.
class DeviceOpacity {
 public:
  DeviceOpacity(ComputeDevice& device, const Opacity& opacity);

  const std::string& build_options() const { return build_options_; }
  const cl::Buffer& parameters() const { return parameters_; }
  const cl::Buffer& table() const { return table_; }

 private:
  std::string build_options_;
  cl::Buffer parameters_;
  cl::Buffer table_;
};

/// The ranges of CT numbers in which an opacity has one mu.
XrcPlateaus plateaus_of(const Opacity& opacity);

}  // namespace xraycast
