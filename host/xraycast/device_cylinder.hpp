#pragma once

#include "params.h"
#include "xraycast/map_geometry.hpp"
#include "xraycast/resident_scan.hpp"

namespace xraycast {

/// The rays of a cylinder map through a resident scan, in the form that kernels/cylinder_ray.h follows: the
/// same samples, split at the shells' edges by length, for every kernel.
class DeviceCylinder {
 public:
  /// Throws InputError when the geometry does not belong to the scan.
  DeviceCylinder(const ResidentScan& scan, const MapGeometry& geometry);

  const XrcCylinder& parameters() const { return parameters_; }
  const cl::Buffer& directions() const { return directions_; }
  const cl::Buffer& shells() const { return shells_; }

 private:
  XrcCylinder parameters_;
  cl::Buffer directions_;
  cl::Buffer shells_;
};

}  // namespace xraycast
