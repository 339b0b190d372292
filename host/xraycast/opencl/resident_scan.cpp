#include "xraycast/opencl/resident_scan.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/stopwatch.hpp"

#include <algorithm>
#include <limits>
#include <memory>

namespace xraycast {
namespace {

static_assert(sizeof(XrcScan) == 24);

XrcScan layout_of(const VolumeGeometry& geometry) {
  constexpr std::int64_t kMost = std::numeric_limits<int>::max() - XRC_BRICK_SLICES;
  if ((geometry.size.x + 1) * (geometry.size.y + 1) > kMost || geometry.size.z > kMost)
    throw InputError("slices of {} x {} pixels are too large for the kernels' 32-bit indices; crop the scan",
                     geometry.size.x, geometry.size.y);
  XrcScan layout{};
  layout.size_x = static_cast<int>(geometry.size.x);
  layout.size_y = static_cast<int>(geometry.size.y);
  layout.size_z = static_cast<int>(geometry.size.z);
  layout.pitch_x = layout.size_x + 1;
  layout.pitch_y = layout.size_y + 1;
  layout.bricks = (layout.size_z + XRC_BRICK_SLICES - 1) / XRC_BRICK_SLICES;
  return layout;
}

std::int64_t bytes_of(const XrcScan& layout) {
  return std::int64_t{layout.pitch_x} * layout.pitch_y * layout.bricks * XRC_BRICK_SLICES *
         static_cast<std::int64_t>(sizeof(std::int16_t));
}

}  // namespace

ScanStorage preferred_storage(ComputeDevice& device, const VolumeGeometry& geometry) {
  const bool fits =
      device.info().is_gpu && device.takes_image(geometry.size.x, geometry.size.y, geometry.size.z);
  return fits && device.self_test().images ? ScanStorage::image : ScanStorage::bricks;
}

ResidentScan::ResidentScan(ComputeDevice& device, const VolumeGeometry& geometry, ScanStorage storage)
    : device_(&device),
      geometry_(geometry),
      storage_(storage),
      layout_(layout_of(geometry)),
      voxels_(device.buffer(CL_MEM_READ_WRITE, bytes_of(layout_))) {}

void ResidentScan::append(std::span<const std::int16_t> hu) {
  const std::int64_t count = static_cast<std::int64_t>(hu.size()) / geometry_.slice_voxels();
  const std::int64_t bricks = (count + XRC_BRICK_SLICES - 1) / XRC_BRICK_SLICES;
  // A processor's driver reads the caller's memory in place; const_cast because OpenCL has one pointer type.
  cl::Buffer slices =
      device_->buffer(CL_MEM_READ_ONLY | CL_MEM_USE_HOST_PTR, static_cast<std::int64_t>(hu.size_bytes()),
                      const_cast<std::int16_t*>(hu.data()));
  cl::Kernel pack = device_->kernel("scan", "pack_bricks");
  set_args(pack, slices, voxels_, layout_, static_cast<cl_int>(slices_done_ / XRC_BRICK_SLICES),
           static_cast<cl_int>(count));
  device_->run(pack, {layout_.pitch_x, layout_.pitch_y, bricks});
  device_->finish();
  slices_done_ += count;
  constant_blocks_ = {};
  paired_.reset();
}

/// Slab by slab, since kernels cannot write to a 3-D image of every device.
cl::Image3D ResidentScan::paired() const {
  constexpr std::int64_t kSlab = 64;
  const Index3 size = geometry_.size;
  cl::Image3D image = device_->image(cl::ImageFormat(CL_R, CL_SIGNED_INT32), size.x, size.y, size.z);
  const std::int64_t most = std::min(kSlab, size.z);
  const cl::Buffer pairs = device_->buffer(
      CL_MEM_READ_WRITE, most * geometry_.slice_voxels() * std::int64_t{sizeof(std::int32_t)});
  cl::Kernel pair = device_->kernel("scan", "pair_slices");
  for (std::int64_t first = 0; first < size.z; first += most) {
    const std::int64_t count = std::min(most, size.z - first);
    set_args(pair, voxels_, layout_, static_cast<cl_int>(first), pairs);
    device_->run(pair, {size.x, size.y, count});
    device_->copy_slices(pairs, image, first, count);
  }
  device_->finish();
  return image;
}

ResidentScan::AnyDirection ResidentScan::any_direction() const {
  if (storage_ == ScanStorage::bricks) return {voxels_, ""};
  if (!paired_) paired_ = paired();
  return {*paired_, " -DSCAN_IMAGE"};
}

std::optional<cl::Buffer> ResidentScan::constant_blocks(const Opacity& opacity) const {
  return constant_blocks_.under(opacity, *this);
}

void ResidentScan::restart(const VolumeGeometry& geometry) {
  geometry_ = geometry;
  layout_ = layout_of(geometry);
  slices_done_ = 0;
  constant_blocks_ = {};
  paired_.reset();
}

ResidentScan load(ComputeDevice& device, SliceSource& source, OutlineFinder& finder, LoadTimings& timings,
                  Progress& progress) {
  const VolumeGeometry& geometry = source.geometry();
  ResidentScan scan(device, geometry);
  constexpr std::int64_t kSlab =
      4 * ResidentScan::kBrickSlices;  // enough for every core to have slices to read
  const auto slab_voxels = static_cast<std::size_t>(kSlab * geometry.slice_voxels());
  const auto slab = std::make_unique_for_overwrite<std::int16_t[]>(slab_voxels);

  progress.begin("reading", geometry.size.z, "slices");
  for (std::int64_t done = 0; done < geometry.size.z;) {
    const Stopwatch reading;
    const std::int64_t wanted = std::min(kSlab, geometry.size.z - done);
    std::int64_t got = 0;
    while (got < wanted) {
      const auto offset = static_cast<std::size_t>(got * geometry.slice_voxels());
      const auto rest = static_cast<std::size_t>((wanted - got) * geometry.slice_voxels());
      const std::int64_t count = source.read({slab.get() + offset, rest}, progress);
      if (count == 0)
        throw InputError("the scan ended after {} of {} slices; copy it again", done + got, geometry.size.z);
      got += count;
    }
    const std::span<const std::int16_t> slices(slab.get(),
                                               static_cast<std::size_t>(got * geometry.slice_voxels()));
    finder.add(slices);
    timings.read_ms += reading.ms();
    const Stopwatch uploading;
    scan.append(slices);
    timings.upload_ms += uploading.ms();
    done += got;
  }
  return scan;
}

ResidentScan upload(ComputeDevice& device, const Volume& volume) {
  return upload(device, volume, preferred_storage(device, volume.geometry()));
}

ResidentScan upload(ComputeDevice& device, const Volume& volume, ScanStorage storage) {
  ResidentScan scan(device, volume.geometry(), storage);
  scan.append(volume.hu());
  return scan;
}

}  // namespace xraycast
