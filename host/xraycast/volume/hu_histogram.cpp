#include "xraycast/volume/hu_histogram.hpp"

#include <algorithm>
#include <numeric>
#include <span>

namespace xraycast {

void HuHistogram::add(std::int16_t hu) {
  ++counts_[static_cast<std::size_t>(std::clamp<int>(hu, kFirst_hu, kLast_hu - 1) - kFirst_hu)];
}

std::int64_t HuHistogram::count(int first_hu, int last_hu) const {
  return std::accumulate(counts_.begin() + (first_hu - kFirst_hu), counts_.begin() + (last_hu - kFirst_hu),
                         std::int64_t{0});
}

bool HuHistogram::is_shifted() const {
  // In stored values: air lies at 24, lung about 200, fat at 924, water at 1024, muscle at 1074, contrast
  // agent and bone above. Noise of 80 HU spreads either tissue over 320.
  constexpr int kAir = 100, kLung = 500, kNoTissue = 800, kFat = 894, kSoft = 1124, kVessel = 1424;
  constexpr std::int64_t kLeast = 500;
  constexpr double kNegative = 0.001, kTissue = 0.3, kBetween = 0.1, kPeak = 0.65;
  constexpr std::int64_t kLeastValues = 32;
  const auto share = [](std::int64_t part, std::int64_t all) {
    return static_cast<double>(part) / static_cast<double>(std::max<std::int64_t>(1, all));
  };
  const std::int64_t body = count(kAir, kLast_hu), tissue = count(kNoTissue, kVessel);
  const auto peak = std::span(counts_).subspan(kFat - kFirst_hu, kSoft - kFat);
  return body >= kLeast && share(count(kFirst_hu + 1, 0), count(kFirst_hu + 1, kLast_hu)) < kNegative &&
         share(tissue, body) > kTissue && share(count(kLung, kNoTissue), body) < kBetween &&
         share(count(kFat, kSoft), tissue) > kPeak &&
         std::ranges::count_if(peak, [](std::int64_t n) { return n > 0; }) >= kLeastValues;
}

}  // namespace xraycast
