#pragma once

#include "xraycast/opencl/compute_device.hpp"

namespace xraycast::test {

/// The OpenCL device that the tests of a program share.
inline ComputeDevice& device() {
  static ComputeDevice device;
  return device;
}

}  // namespace xraycast::test
