#include "xraycast/base/metal_depth.hpp"

#include <algorithm>

namespace xraycast {
namespace {

constexpr std::size_t kBins = 1024;  // up to a depth of 51, and what is above
constexpr float kBinsPerDepth = 20;

}  // namespace

DepthCounts::DepthCounts() : counts_(kBins) {}

void DepthCounts::add(float depth) {
  ++counts_[static_cast<std::size_t>(std::clamp(depth * kBinsPerDepth, 0.0f, static_cast<float>(kBins - 1)))];
}

void DepthCounts::add(const DepthCounts& other) {
  for (std::size_t bin = 0; bin < kBins; ++bin) counts_[bin] += other.counts_[bin];
}

std::optional<float> DepthCounts::metal_from() const {
  constexpr double kLeast = 0.001, kMost = 0.25, kStays = 0.45, kEdges = 0.5;
  constexpr std::size_t kRise = 30;  // bins
  std::vector<double> above(kBins + kRise);
  for (std::size_t bin = kBins; bin-- > 0;) above[bin] = above[bin + 1] + counts_[bin];
  const double all = above[0];
  double most = kStays;
  std::size_t rise = kBins;
  for (std::size_t bin = 0; bin < kBins; ++bin) {
    if (above[bin] > kMost * all || above[bin + kRise] <= kLeast * all) continue;
    if (above[bin + kRise] <= most * above[bin]) continue;
    most = above[bin + kRise] / above[bin];
    rise = bin;
  }
  if (rise == kBins) return {};
  const double with_edges = above[rise] / kEdges;
  while (rise > 0 && above[rise - 1] <= with_edges) --rise;
  return static_cast<float>(rise) / kBinsPerDepth;
}

}  // namespace xraycast
