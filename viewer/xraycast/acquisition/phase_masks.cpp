#include "xraycast/acquisition/phase_masks.hpp"

#include <algorithm>
#include <cmath>

namespace xraycast {
namespace {

double phase_distance(double a, double b, bool wraps) {
  const double away = std::abs(a - b);
  return wraps ? std::min(away, 1 - away) : away;
}

}  // namespace

void PhaseMasks::add(double phase, std::span<const float> picture) {
  ++count_;
  const int place = std::clamp(static_cast<int>(kMost * phase), 0, kMost - 1);
  const auto known =
      std::find_if(masks_.begin(), masks_.end(), [place](const Mask& mask) { return mask.place == place; });
  if (known == masks_.end()) {
    masks_.push_back({place, 1, phase, {picture.begin(), picture.end()}});
    return;
  }
  const double share = 1.0 / ++known->count;
  known->phase += share * (phase - known->phase);
  for (std::size_t i = 0; i < picture.size(); ++i)
    known->picture[i] += static_cast<float>(share) * (picture[i] - known->picture[i]);
}

std::span<const float> PhaseMasks::nearest(double phase, bool wraps) const {
  const auto away = [&](const Mask& mask) { return phase_distance(mask.phase, phase, wraps); };
  return std::min_element(masks_.begin(), masks_.end(),
                          [&](const Mask& a, const Mask& b) { return away(a) < away(b); })
      ->picture;
}

}  // namespace xraycast
