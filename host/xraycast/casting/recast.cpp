#include "xraycast/casting/recast.hpp"

#include "xraycast/base/error.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

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

RecastSession::RecastSession(ComputeDevice& device, const Basis& basis)
    : device_(&device),
      knots_hu_(basis.knots_hu),
      mu_per_mm_(basis.knots_hu.size(), 0.0f),
      map_{basis.geometry, Opacity("none", {{basis.knots_hu.front(), 0}}), basis.source, {}},
      touched_(device.upload(std::span<const std::uint64_t>(basis.touched))),
      first_row_(device.upload(std::span<const std::uint32_t>(first_rows(basis.touched)))),
      weights_(device.upload(std::span<const std::uint16_t>(basis.weights))),
      unit_mm_(device.upload(std::span<const float>(units_mm(basis)))) {
  map_.tau.assign(static_cast<std::size_t>(basis.geometry.layers()) * map_.layer_size(), 0.0f);
  tau_ = device.buffer(CL_MEM_READ_WRITE | CL_MEM_USE_HOST_PTR,
                       static_cast<std::int64_t>(map_.tau.size() * sizeof(float)), map_.tau.data());
}

void RecastSession::run(cl::Kernel& kernel) {
  const MapGeometry& geometry = map_.geometry;
  // A processor's work-item takes enough tiles to be worth starting, a GPU's as few as possible.
  const int tiles_per_item = device_->info().is_gpu ? 1 : 64;
  const std::int64_t tiles = tile_count(geometry);
  kernel.setArg(0, touched_);
  kernel.setArg(1, first_row_);
  kernel.setArg(2, weights_);
  kernel.setArg(3, static_cast<cl_long>(tiles));
  kernel.setArg(4, tiles_per_item);
  kernel.setArg(5, geometry.width);
  kernel.setArg(6, geometry.height);
  kernel.setArg(7, geometry.layers());
  kernel.setArg(8, unit_mm_);
  kernel.setArg(9, tau_);
  const cl::Event done = device_->run(kernel, {(tiles + tiles_per_item - 1) / tiles_per_item, 1, 1},
                                      {device_->info().is_gpu ? 64 : 1, 1, 1});
  device_->bring_to_host(tau_);
  kernel_ms_ = duration_ms(done);
}

void RecastSession::recast_all() {
  cl::Kernel kernel = device_->kernel("recast", "recast");
  const cl::Buffer mu = device_->upload(std::span<const float>(mu_per_mm_));  // an argument does not own it
  kernel.setArg(10, mu);
  run(kernel);
  // Every move rounds tau by up to 2^-24 of its largest value, so that a thousand stay below 1e-4.
  moves_left_ = 1000;
}

const BodyMap& RecastSession::recast(const Opacity& opacity) {
  check_representable(opacity, knots_hu_);
  for (std::size_t k = 0; k < knots_hu_.size(); ++k)
    mu_per_mm_[k] = static_cast<float>(opacity.mu_per_mm(knots_hu_[k]));
  map_.opacity = opacity;
  recast_all();
  return map_;
}

const BodyMap& RecastSession::set_knot(std::size_t knot, double mu_per_mm) {
  if (knot >= knots_hu_.size())
    throw InputError("there is no knot {}: the basis has {}", knot, knots_hu_.size());
  if (!std::isfinite(mu_per_mm) || mu_per_mm < 0)
    throw InputError("mu of knot {} is {} /mm, but has to be finite and not negative", knot, mu_per_mm);
  const float before = std::exchange(mu_per_mm_[knot], static_cast<float>(mu_per_mm));
  std::vector<Opacity::Knot> knots;
  for (std::size_t k = 0; k < knots_hu_.size(); ++k) knots.push_back({knots_hu_[k], mu_per_mm_[k]});
  map_.opacity = Opacity(map_.opacity.name(), std::move(knots));

  if (moves_left_-- == 0) {
    recast_all();
    return map_;
  }
  cl::Kernel kernel = device_->kernel("recast", "move_knot");
  kernel.setArg(10, static_cast<int>(knot));
  kernel.setArg(11, mu_per_mm_[knot] - before);
  run(kernel);
  return map_;
}

void RecastSession::reknot(const ResidentScan& scan, std::vector<double> knots_hu, Progress& progress) {
  Basis basis = make_basis(scan, map_.geometry, std::move(knots_hu), progress);
  basis.source = map_.source;
  *this = RecastSession(*device_, basis);
}

}  // namespace xraycast
