#pragma once

#include "xraycast/casting/map_geometry.hpp"
#include "xraycast/kernels/params.h"
#include "xraycast/opencl/resident_scan.hpp"

#include <string>

namespace xraycast {

/// The rays of a cylinder or sphere map through a resident scan, in the form that the kernels use: the same
/// samples, split at the shells' edges by length, for every kernel.
class DeviceRays {
 public:
  /// Throws InputError when the geometry does not match the scan, or is a rectangle's.
  DeviceRays(const ResidentScan& scan, const MapGeometry& geometry);

  XrcCylinder cylinder() const;
  XrcSphere sphere() const;

  const cl::Buffer& centres() const { return centres_; }    ///< cylinder: of every slice, in voxels
  const cl::Buffer& azimuths() const { return azimuths_; }  ///< sine and cosine of every column's phi
  const cl::Buffer& polars() const { return polars_; }      ///< sphere: sine and cosine of every row's theta
  const cl::Buffer& shells() const { return shells_; }

  /// Build options of the kernels for these rays, and the number of slices per work-item: one where every
  /// slice has a centre of its own.
  std::string build_options() const;
  int slices_per_item() const;

 private:
  const ResidentScan& scan_;
  MapGeometry geometry_;
  cl::Buffer centres_, azimuths_, polars_, shells_;
};

}  // namespace xraycast
