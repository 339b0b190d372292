#pragma once

#include "xraycast/kernels/params.h"
#include "xraycast/opencl/compute_device.hpp"
#include "xraycast/opencl/constant_blocks.hpp"
#include "xraycast/volume/body_outline.hpp"
#include "xraycast/volume/slice_source.hpp"
#include "xraycast/volume/volume.hpp"

#include <cstdint>
#include <optional>
#include <span>
#include <string>

namespace xraycast {

/// How a scan is stored on a device: always in bricks, a buffer of 16 interleaved slices each (XrcScan of
/// xraycast/kernels/params.h).
enum class ScanStorage {
  bricks,  ///< of which a work-item takes all slices at once; for processors
  image,   ///< of which it takes two; rays in any direction read a 3-D image, whose cache follows them; for
           ///< GPUs
};

/// Image on a GPU that has them, passes the self-test and takes the size; bricks elsewhere.
ScanStorage preferred_storage(ComputeDevice& device, const VolumeGeometry& geometry);

/// A scan in a device's memory, where the kernels read it. Move-only.
class ResidentScan {
 public:
  /// Allocates the memory; throws DeviceError when the device has not enough.
  ResidentScan(ComputeDevice& device, const VolumeGeometry& geometry, ScanStorage storage);
  ResidentScan(ComputeDevice& device, const VolumeGeometry& geometry)
      : ResidentScan(device, geometry, preferred_storage(device, geometry)) {}
  ResidentScan(ResidentScan&&) = default;
  ResidentScan& operator=(ResidentScan&&) = default;

  /// The next slices, from slice 0 on. All calls but the last take a multiple of kBrickSlices. Returns when
  /// `hu` may be reused.
  void append(std::span<const std::int16_t> hu);

  /// Reuses the memory for another scan with slices of the same size, and not more of them than at first.
  void restart(const VolumeGeometry& geometry);

  static constexpr std::int64_t kBrickSlices = XRC_BRICK_SLICES;

  ComputeDevice& device() const { return *device_; }
  const VolumeGeometry& geometry() const { return geometry_; }
  const XrcScan& layout() const { return layout_; }
  ScanStorage storage() const { return storage_; }

  /// The bricks.
  const cl::Buffer& voxels() const { return voxels_; }

  /// What kernels for rays in any direction read, with the build option that goes with it: the image of
  /// ScanStorage::image (scan_access.h), which is made at first use, after the last slice, and takes twice
  /// the scan's memory; else the bricks. Throws DeviceError when the device has not enough. Not thread-safe.
  struct AnyDirection {
    const cl::Memory& voxels;
    std::string build_options;
  };
  AnyDirection any_direction() const;

  /// The blocks in which an opacity gives one mu, if there are many (ConstantBlocks). After the last slice.
  /// Not thread-safe.
  std::optional<cl::Buffer> constant_blocks(const Opacity& opacity) const;

  /// Number of slices per work-item of the casting kernel.
  int slices_per_item() const { return storage_ == ScanStorage::image ? 2 : XRC_BRICK_SLICES; }

 private:
  cl::Image3D paired() const;

  ComputeDevice* device_;
  VolumeGeometry geometry_;
  ScanStorage storage_;
  XrcScan layout_;
  cl::Buffer voxels_;
  std::int64_t slices_done_ = 0;
  mutable std::optional<cl::Image3D> paired_;
  mutable ConstantBlocks constant_blocks_;
};

/// Wall time of the two halves of `load`.
struct LoadTimings {
  double read_ms = 0, upload_ms = 0;
};

/// Reads a scan slab by slab into the device, never holding it whole in the host's memory. `finder` sees
/// every slice. Stage "reading" of `progress`. Throws InputError when the source ends early.
ResidentScan load(ComputeDevice& device, SliceSource& source, OutlineFinder& finder, LoadTimings& timings,
                  Progress& progress);

/// Uploads a volume that is in memory.
ResidentScan upload(ComputeDevice& device, const Volume& volume);
ResidentScan upload(ComputeDevice& device, const Volume& volume, ScanStorage storage);

}  // namespace xraycast
