#include "xraycast/opencl/device_opacity.hpp"

#include "xraycast/kernels/params.h"
#include "xraycast/volume/volume.hpp"

#include <fmt/format.h>

#include <cmath>
#include <vector>

namespace xraycast {
namespace {

static_assert(sizeof(XrcOpacity) == 4 * (3 + 2 * XRC_MAX_RAMPS));

struct Ramp {
  double from_hu, slope;
};

/// mu(hu) = mu of the first knot + sum of slope * max(0, hu - from_hu).
std::vector<Ramp> ramps_of(const Opacity& opacity) {
  std::vector<Ramp> ramps;
  double slope = 0;
  const auto bend_at = [&](double hu, double next_slope) {
    if (next_slope != slope) ramps.push_back({hu, next_slope - slope});
    slope = next_slope;
  };
  const auto knots = opacity.knots();
  for (std::size_t i = 0; i + 1 < knots.size(); ++i)
    bend_at(knots[i].hu, (knots[i + 1].mu_per_mm - knots[i].mu_per_mm) / (knots[i + 1].hu - knots[i].hu));
  // No voxel lies above kMaxHu, so a bend there is never reached.
  if (knots.back().hu < kMaxHu) bend_at(knots.back().hu, 0);
  return ramps;
}

struct Entry {
  float mu_per_mm, change_per_hu;
};

std::vector<Entry> table_of(const Opacity& opacity, double first_hu) {
  const int entries = static_cast<int>(std::ceil(opacity.knots().back().hu) - first_hu) + 1;
  std::vector<Entry> table;
  for (int i = 0; i < entries; ++i) {
    const double hu = first_hu + i, mu = opacity.mu_per_mm(hu);
    table.push_back({static_cast<float>(mu), static_cast<float>(opacity.mu_per_mm(hu + 1) - mu)});
  }
  return table;
}

}  // namespace

DeviceOpacity::DeviceOpacity(ComputeDevice& device, const Opacity& opacity) {
  XrcOpacity parameters{};
  std::vector<Entry> table(1);
  std::vector<Ramp> ramps = ramps_of(opacity);
  if (ramps.size() <= XRC_MAX_RAMPS) {
    if (ramps.empty()) ramps.push_back({0, 0});  // a constant
    parameters.mu0 = static_cast<float>(opacity.knots().front().mu_per_mm);
    for (std::size_t i = 0; i < ramps.size(); ++i) {
      parameters.from[i] = static_cast<float>(ramps[i].from_hu);
      parameters.slope[i] = static_cast<float>(ramps[i].slope);
    }
    build_options_ = fmt::format("-DRAMPS={}", ramps.size());
  } else {
    const double first_hu = std::floor(opacity.knots().front().hu);
    table = table_of(opacity, first_hu);
    parameters.first_hu = static_cast<float>(first_hu);
    parameters.entries = static_cast<int>(table.size());
    build_options_ = "-DRAMPS=0";
  }
  parameters_ = device.upload(std::span<const XrcOpacity>(&parameters, 1));
  table_ = device.upload(std::span<const Entry>(table));
}

XrcPlateaus plateaus_of(const Opacity& opacity) {
  constexpr float kAll_hu = 1e6f;  // beyond all CT numbers
  static_assert(XRC_MAX_PLATEAUS >= Opacity::kMaxKnots / 2 + 2, "every other knot may begin one");
  const auto knots = opacity.knots();
  XrcPlateaus plateaus{};
  float from_hu = -kAll_hu;
  for (std::size_t i = 0; i < knots.size(); ++i) {
    const bool is_last = i + 1 == knots.size();
    if (!is_last && knots[i + 1].mu_per_mm == knots[i].mu_per_mm) continue;
    const float to_hu = is_last ? kAll_hu : static_cast<float>(knots[i].hu);
    if (from_hu < to_hu) {
      plateaus.from_hu[plateaus.count] = from_hu;
      plateaus.to_hu[plateaus.count++] = to_hu;
    }
    if (!is_last) from_hu = static_cast<float>(knots[i + 1].hu);
  }
  return plateaus;
}

}  // namespace xraycast
