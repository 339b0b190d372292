#include "xraycast/casting/basis.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/casting/device_rays.hpp"

#include <algorithm>
#include <bit>
#include <iterator>
#include <limits>
#include <utility>

namespace xraycast {
namespace {

/// As `weigh` of kernels/basis.cl takes them.
struct DeviceKnot {
  float hu, per_hu;
};

std::vector<DeviceKnot> device_knots(std::span<const double> knots_hu) {
  std::vector<DeviceKnot> knots;
  for (const double hu : knots_hu) knots.push_back({static_cast<float>(hu), 0});
  for (std::size_t i = 0; i + 1 < knots.size(); ++i) knots[i].per_hu = 1 / (knots[i + 1].hu - knots[i].hu);
  knots.push_back({std::numeric_limits<float>::infinity(), 0});
  return knots;
}

/// For every whole HU from air on, the last knot at or below it; the first knot where there is none.
std::vector<std::uint8_t> knots_below(std::span<const DeviceKnot> knots) {
  std::vector<std::uint8_t> below;
  std::uint8_t knot = 0;
  for (int hu = XRC_PADDING_HU; hu <= kMaxHu; ++hu) {
    while (knots[knot + 1].hu <= static_cast<float>(hu)) ++knot;
    below.push_back(knot);
  }
  return below;
}

std::vector<std::int64_t> count_hu(const ResidentScan& scan) {
  ComputeDevice& device = scan.device();
  // A histogram for every brick: 32 bits hold the voxels of 16 slices.
  std::vector<std::uint32_t> of_bricks(static_cast<std::size_t>(scan.layout().bricks) * XRC_HISTOGRAM_BINS,
                                       0);
  const cl::Buffer counts = device.upload(std::span<const std::uint32_t>(of_bricks), CL_MEM_READ_WRITE);
  cl::Kernel kernel = device.kernel("basis", "count_hu");
  set_args(kernel, scan.voxels(), scan.layout(), Basis::kHistogramStride, counts);
  const int rows = (scan.layout().size_y + Basis::kHistogramStride - 1) / Basis::kHistogramStride;
  device.run(kernel, {rows, scan.layout().bricks, 1}, {1, 1, 1});
  device.download(counts, std::span(of_bricks));
  std::vector<std::int64_t> histogram(XRC_HISTOGRAM_BINS, 0);
  for (std::size_t i = 0; i < of_bricks.size(); ++i) histogram[i % XRC_HISTOGRAM_BINS] += of_bricks[i];
  return histogram;
}

/// The tiles [first, end) of rows; all where there are none.
std::pair<std::int64_t, std::int64_t> tiles_of(const MapGeometry& geometry, const MovedRows* rows) {
  const std::int64_t of_brick = std::int64_t{geometry.layers()} * geometry.width;
  if (!rows) return {0, tile_count(geometry)};
  const std::int64_t slice = geometry.height - rows->first - rows->count;
  return {slice / Basis::kTileSlices * of_brick,
          (slice + rows->count + Basis::kTileSlices - 1) / Basis::kTileSlices * of_brick};
}

}  // namespace

double Basis::unit_mm(int layer) const {
  return (geometry.radii_mm[layer + 1] - geometry.radii_mm[layer]) / XRC_WEIGHT_SUM;
}

std::int64_t tile_count(const MapGeometry& geometry) {
  const std::int64_t bricks = (geometry.height + Basis::kTileSlices - 1) / Basis::kTileSlices;
  return bricks * geometry.layers() * geometry.width;
}

void validate_knots(std::span<const double> knots_hu, const std::string& name) {
  if (knots_hu.empty() || knots_hu.size() > Opacity::kMaxKnots)
    throw InputError("{}: {} knots, but there must be 1 to {}", name, knots_hu.size(), Opacity::kMaxKnots);
  for (std::size_t i = 0; i < knots_hu.size(); ++i) {
    if (!(knots_hu[i] >= kPaddingHu && knots_hu[i] <= kMaxHu))
      throw InputError("{}: knot {} is at {} HU, outside {} to {}", name, i, knots_hu[i], kPaddingHu, kMaxHu);
    if (i > 0 && static_cast<float>(knots_hu[i]) <= static_cast<float>(knots_hu[i - 1]))
      throw InputError("{}: knot {} at {} HU is not above the one before it, {} HU", name, i, knots_hu[i],
                       knots_hu[i - 1]);
  }
}

std::vector<double> useful_knots_hu(const Opacity& opacity) {
  constexpr double kUsual[] = {-1024, -1000, -900, -800, -700, -600, -500, -400, -300, -200, -150,
                               -100,  -50,   0,    50,   100,  150,  200,  250,  300,  350,  400,
                               500,   600,   700,  800,  1000, 1200, 1500, 2000, 3000};
  std::vector<double> own, all;
  for (const Opacity::Knot& knot : opacity.knots()) own.push_back(knot.hu);
  std::ranges::set_union(own, kUsual, std::back_inserter(all));
  return all.size() <= Opacity::kMaxKnots ? all : own;
}

Basis make_basis(const ResidentScan& scan, const MapGeometry& geometry, std::vector<double> knots_hu,
                 Progress& progress, const MovedRows* moved) {
  validate_knots(knots_hu, "basis");
  if (geometry.ray_layout != RayLayout::cylinder)
    throw InputError("only cylinder maps have a basis, not a {}", to_string(geometry.ray_layout));
  const DeviceRays rays(scan, geometry);
  ComputeDevice& device = scan.device();
  const std::int64_t tiles = tile_count(geometry);
  progress.begin("weighing", tiles, "tiles");
  Basis basis{geometry, std::move(knots_hu), {}, count_hu(scan), {}, {}};
  basis.touched.resize(static_cast<std::size_t>(tiles));

  // The device has room for all rows of some tiles; those that hold anything are collected here.
  constexpr std::int64_t kRoom_B = 64 << 20;
  const std::size_t tile_weights = basis.knots_hu.size() * Basis::kTileSlices;
  const std::int64_t step =
      std::min(tiles, kRoom_B / static_cast<std::int64_t>(tile_weights * sizeof(std::uint16_t)));
  std::vector<std::uint16_t> dense(static_cast<std::size_t>(step) * tile_weights);
  const cl::Buffer weights =
      device.buffer(CL_MEM_READ_WRITE, static_cast<std::int64_t>(dense.size() * sizeof(std::uint16_t)));
  const cl::Buffer touched = device.buffer(CL_MEM_READ_WRITE, step * std::int64_t{sizeof(std::uint64_t)});

  const std::vector<DeviceKnot> knot_list = device_knots(basis.knots_hu);
  const cl::Buffer knots = device.upload(std::span<const DeviceKnot>(knot_list));
  const cl::Buffer below = device.upload(std::span<const std::uint8_t>(knots_below(knot_list)));
  cl::Kernel kernel = device.kernel("basis", "weigh_tiles",
                                    rays.build_options() + (moved ? moved->field.build_options() : ""));
  constexpr unsigned kFirstOfMoved = 14;  // of the kernel's arguments
  if (moved) moved->field.set_args(kernel, kFirstOfMoved);
  const auto [begin, end] = tiles_of(geometry, moved);
  for (std::int64_t first = begin; first < end; first += step) {
    const std::int64_t count = std::min(step, end - first);
    set_args(kernel, scan.voxels(), scan.layout(), rays.cylinder(), rays.centres(), rays.azimuths(),
             rays.scales(), rays.shells(), knots, below, static_cast<cl_int>(basis.knots_hu.size()),
             static_cast<cl_long>(first), static_cast<cl_int>(count), touched, weights);
    device.run(kernel, {count, 1, 1}, {device.info().is_gpu ? 64 : 1, 1, 1});
    const std::span masks = std::span(basis.touched).subspan(first, count);
    device.download(touched, masks);
    device.download(weights, std::span(dense).first(count * tile_weights));
    auto tile = dense.begin();
    for (const std::uint64_t mask : masks) {
      basis.weights.insert(basis.weights.end(), tile, tile + std::popcount(mask) * Basis::kTileSlices);
      tile += static_cast<std::ptrdiff_t>(tile_weights);
    }
    progress.advance(count);
  }
  return basis;
}

}  // namespace xraycast
