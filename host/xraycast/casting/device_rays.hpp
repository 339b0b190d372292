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
  const cl::Buffer& scales() const { return scales_; }      ///< see upload_scales
  const cl::Buffer& shells() const { return shells_; }

  /// Build options of the kernels for these rays, and the number of a cylinder's slices per work-item: one
  /// where the slices of an item have centres or outlines of their own.
  std::string build_options() const;
  int slices_per_item() const;

 private:
  bool has_rows_alike() const;

  const ResidentScan& scan_;
  MapGeometry geometry_;
  cl::Buffer centres_, azimuths_, polars_, scales_, shells_;
};

/// By what the rays of a map's texels are longer than its radii (MapGeometry::scale): one a column, or, where
/// rows differ, width x height.
cl::Buffer upload_scales(ComputeDevice& device, const MapGeometry& geometry);

/// From one row of these to the next.
int scale_stride(const MapGeometry& geometry);

}  // namespace xraycast
