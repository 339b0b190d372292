#include "xraycast/casting/recast.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/casting/device_rays.hpp"

#include <algorithm>
#include <bit>

namespace xraycast {
namespace {

/// Where the rows of each tile begin.
std::vector<std::uint32_t> first_rows(std::span<const std::uint64_t> touched) {
  std::vector<std::uint32_t> first;
  first.reserve(touched.size());
  std::uint32_t row = 0;
  for (const std::uint64_t mask : touched) {
    first.push_back(row);
    row += static_cast<std::uint32_t>(std::popcount(mask));
  }
  return first;
}

std::vector<float> units_mm(const Basis& basis) {
  std::vector<float> units;
  for (int k = 0; k < basis.geometry.layers(); ++k) units.push_back(static_cast<float>(basis.unit_mm(k)));
  return units;
}

void check_representable(const Opacity& opacity, std::span<const double> knots_hu) {
  const auto knots = opacity.knots();
  for (std::size_t i = 0; i < knots.size(); ++i) {
    const auto above = std::ranges::lower_bound(knots_hu, knots[i].hu);
    if (above != knots_hu.end() && *above == knots[i].hu) continue;
    const std::string nearest =
        above == knots_hu.begin() ? fmt::format("the first is at {}", knots_hu.front())
        : above == knots_hu.end() ? fmt::format("the last is at {}", knots_hu.back())
                                  : fmt::format("the nearest are at {} and {}", *std::prev(above), *above);
    throw InputError("opacity {}: knots[{}] at {} HU is not a knot of the basis; {} HU", opacity.name(), i,
                     knots[i].hu, nearest);
  }
}

}  // namespace

RecastSession::Tiles::Tiles(ComputeDevice& device, std::span<const std::uint64_t> of_touched,
                            std::span<const std::uint16_t> of_weights)
    : touched(device.upload(of_touched)),
      first_row(device.upload(std::span<const std::uint32_t>(first_rows(of_touched)))),
      weights(device.upload(of_weights)) {}

RecastSession::RecastSession(ComputeDevice& device, const Basis& basis)
    : device_(&device),
      knots_hu_(basis.knots_hu),
      map_{basis.geometry, Opacity("none", {{basis.knots_hu.front(), 0}}), basis.source, {}},
      tiles_(device, basis.touched, basis.weights),
      keys_(basis.keys),
      unit_mm_(device.upload(std::span<const float>(units_mm(basis)))),
      scales_(upload_scales(device, basis.geometry)) {
  map_.frame_of_reference_uid = basis.frame_of_reference_uid;
  map_.tau.assign(static_cast<std::size_t>(basis.geometry.layers()) * map_.layer_size(), 0.0f);
  tau_ = device.buffer(CL_MEM_READ_WRITE | CL_MEM_USE_HOST_PTR,
                       static_cast<std::int64_t>(map_.tau.size() * sizeof(float)), map_.tau.data());
}

void RecastSession::recast_tiles(const Tiles& of_map, const cl::Buffer& mu) {
  const MapGeometry& geometry = map_.geometry;
  // A processor's work-item takes enough tiles to be worth starting, a GPU's as few as possible.
  const cl_int tiles_per_item = device_->info().is_gpu ? 1 : 64;
  const cl_long tiles = tile_count(geometry);
  cl::Kernel kernel = device_->kernel("recast", "recast");
  set_args(kernel, of_map.touched, of_map.first_row, of_map.weights, tiles, tiles_per_item, geometry.width,
           geometry.height, geometry.layers(), unit_mm_, scales_, scale_stride(geometry), mu, tau_);
  const cl::Event done = device_->run(kernel, {(tiles + tiles_per_item - 1) / tiles_per_item, 1, 1},
                                      {device_->info().is_gpu ? 64 : 1, 1, 1});
  device_->bring_to_host(tau_);
  kernel_ms_ += duration_ms(done);
}

/// The map's own values become those that its bytes stand for.
void RecastSession::recast_keys(const cl::Buffer& mu) {
  std::vector<KeyValues> values;
  const auto take = [&](const KeyRows& rows) {
    values.push_back({rows, {own_rows(map_.tau, map_.geometry, rows)}});
  };
  take({-1, 0, map_.geometry.height});
  for (const BasisKeys::Key& key : keys_->others) {
    if (key.rows.count > 0) recast_tiles(Tiles(*device_, key.touched, key.weights), mu);
    take(key.rows);
  }
  auto maps = std::make_shared<KeyMaps>(keys_->phases, map_.geometry, values);
  maps->motion = keys_->motion;
  const std::vector<float> at_rest =
      maps->values_at(0, std::vector<double>(keys_->phases.phases().size(), 0.0));
  std::ranges::copy(at_rest, map_.tau.begin());
  map_.precision = MapPrecision::byte;
  map_.keys = std::move(maps);
}

const BodyMap& RecastSession::recast(const Opacity& opacity) {
  check_representable(opacity, knots_hu_);
  std::vector<float> mu_per_mm;
  for (const double hu : knots_hu_) mu_per_mm.push_back(static_cast<float>(opacity.mu_per_mm(hu)));
  const cl::Buffer mu = device_->upload(std::span<const float>(mu_per_mm));
  kernel_ms_ = 0;
  recast_tiles(tiles_, mu);
  if (keys_) recast_keys(mu);
  map_.attenuation = opacity;
  return map_;
}

}  // namespace xraycast
