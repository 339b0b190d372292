#include "xraycast/opencl/constant_blocks.hpp"

#include "scan_layout.h"
#include "xraycast/opencl/device_opacity.hpp"
#include "xraycast/opencl/resident_scan.hpp"

#include <cstdint>
#include <numeric>
#include <span>
#include <vector>

namespace xraycast {
namespace {

static_assert(sizeof(XrcBlock) == 8);

std::int64_t columns_of(const XrcScan& layout) {
  return std::int64_t{blocks_of(layout.size_x)} * blocks_of(layout.size_y);
}

std::int64_t count_of(const XrcScan& layout) { return columns_of(layout) * layout.bricks; }

cl::Buffer ranges_of(const ResidentScan& scan) {
  ComputeDevice& device = scan.device();
  const XrcScan& layout = scan.layout();
  cl::Buffer ranges = device.buffer(CL_MEM_READ_WRITE,
                                    count_of(layout) * static_cast<std::int64_t>(2 * sizeof(std::int16_t)));
  cl::Kernel find = device.kernel("blocks", "block_ranges", "-DRAMPS=1");
  set_args(find, scan.voxels(), layout, ranges);
  device.run(find, {blocks_of(layout.size_x), blocks_of(layout.size_y), layout.bricks}, {1, 1, 1});
  return ranges;
}

}  // namespace

std::optional<cl::Buffer> ConstantBlocks::under(const Opacity& opacity, const ResidentScan& scan) {
  if (opacity_ == opacity) return blocks_;
  if (!ranges_()) ranges_ = ranges_of(scan);
  ComputeDevice& device = scan.device();
  const XrcScan& layout = scan.layout();
  const cl::Buffer blocks =
      device.buffer(CL_MEM_READ_WRITE, count_of(layout) * static_cast<std::int64_t>(sizeof(XrcBlock)));
  std::vector<std::int32_t> constants(static_cast<std::size_t>(columns_of(layout)));
  const cl::Buffer counts =
      device.buffer(CL_MEM_WRITE_ONLY, static_cast<std::int64_t>(std::span(constants).size_bytes()));
  const DeviceOpacity on_device(device, opacity);
  const XrcPlateaus one_mu = plateaus_of(opacity);
  const cl::Buffer plateaus = device.upload(std::span(&one_mu, 1));
  cl::Kernel kernel = device.kernel("blocks", "blocks_under", on_device.build_options());
  set_args(kernel, ranges_, layout, on_device.parameters(), on_device.table(), plateaus, blocks, counts);
  device.run(kernel, {columns_of(layout), 1, 1}, {64, 1, 1});
  device.download(counts, std::span(constants));

  constexpr std::int64_t kFewest = 20;  // one in so many
  const auto constant = std::accumulate(constants.begin(), constants.end(), std::int64_t{0});
  opacity_ = opacity;
  return blocks_ = constant * kFewest >= count_of(layout) ? std::optional(blocks) : std::nullopt;
}

}  // namespace xraycast
