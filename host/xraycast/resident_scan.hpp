#pragma once

#include <cstdint>
#include <span>

#include "params.h"
#include "xraycast/body_outline.hpp"
#include "xraycast/device.hpp"
#include "xraycast/slice_source.hpp"
#include "xraycast/volume.hpp"

namespace xraycast {

/// A scan in a device's memory, in the layout that the kernels read (XrcScan of kernels/params.h). Move-only.
class ResidentScan {
 public:
  /// Takes the memory; throws DeviceError when the device has not enough.
  ResidentScan(Device& device, const VolumeGeometry& geometry);
  ResidentScan(ResidentScan&&) = default;
  ResidentScan& operator=(ResidentScan&&) = default;

  /// The next slices, from slice 0 on. All calls but the last take a multiple of kBrickSlices. Returns when the
  /// slices are no longer needed.
  void append(std::span<const std::int16_t> hu);

  static constexpr std::int64_t kBrickSlices = XRC_BRICK_SLICES;

  Device& device() const { return *device_; }
  const VolumeGeometry& geometry() const { return geometry_; }
  const XrcScan& layout() const { return layout_; }
  const cl::Buffer& bricks() const { return bricks_; }

 private:
  Device* device_;
  VolumeGeometry geometry_;
  XrcScan layout_;
  cl::Buffer bricks_;
  int bricks_done_ = 0;
};

/// Wall time of the two halves of `load`.
struct LoadTimings {
  double read_ms = 0, upload_ms = 0;
};

/// Reads a scan slab by slab into the device, never holding it whole in the host's memory. `finder` sees every slice.
/// Stage "reading" of `progress`. Throws InputError when the source ends early.
ResidentScan load(Device& device, SliceSource& source, OutlineFinder& finder, LoadTimings& timings, Progress& progress);

/// A volume that is already there.
ResidentScan upload(Device& device, const Volume& volume);

}  // namespace xraycast
