#include "xraycast/fluoroscope/exposure_control.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace xraycast {
namespace {

/// The first integer from `first` on for which a condition holds that holds for all that follow; at most
/// `last`.
template <typename Condition>
int first_of(int first, int last, const Condition& holds) {
  while (first < last) {
    const int middle = first + (last - first) / 2;
    if (holds(middle))
      last = middle;
    else
      first = middle + 1;
  }
  return last;
}

}  // namespace

ExposureControl::ExposureControl(XrayTube tube, double target_kev, std::optional<int> kvp,
                                 std::optional<double> mas, SignalPerMas signal, PermittedMas permitted)
    : tube_(tube),
      target_kev_(target_kev),
      kvp_(kvp),
      mas_(mas),
      signal_(std::move(signal)),
      permitted_(std::move(permitted)) {}

double ExposureControl::within_limits(int kvp, double mas) const {
  const double most = std::min(highest_mas(tube_, kvp), permitted_(kvp));
  return std::clamp(mas, std::min(lowest_mas(tube_), most), most);
}

Technique ExposureControl::technique_for(double g_cm2) const {
  constexpr double kThin_kvp = 60, kThin_g_cm2 = 8, kKvpPer_g_cm2 = 1.5;
  const auto mas_at = [&](int kvp) {
    return mas_ ? *mas_ : within_limits(kvp, target_kev_ / std::max(signal_(kvp, g_cm2), 1e-300));
  };
  if (kvp_) return {*kvp_, mas_at(*kvp_)};
  const int highest = static_cast<int>(tube_.highest_kvp), lowest = static_cast<int>(tube_.lowest_kvp);
  const double wanted = kThin_kvp + kKvpPer_g_cm2 * std::max(0.0, g_cm2 - kThin_g_cm2);
  const int curve =
      mas_ ? lowest : std::clamp(static_cast<int>(std::lround(std::min(wanted, 1e3))), lowest, highest);
  constexpr double kEnough = 0.97, kTooMuch = 1.03;
  const auto reached = [&](int kvp) { return signal_(kvp, g_cm2) * mas_at(kvp) / target_kev_; };
  const auto can = [&](int kvp) { return !mas_ || *mas_ <= highest_mas(tube_, kvp); };
  // The signal rises with the voltage, and so what the tube reaches at most and at least.
  int kvp = curve;
  if (reached(curve) < kEnough)
    kvp = first_of(curve, highest, [&](int at) { return !can(at + 1) || reached(at) >= kEnough; });
  else if (reached(curve) > kTooMuch)
    kvp = first_of(lowest, curve, [&](int at) { return reached(at + 1) > kTooMuch; });
  return {kvp, mas_at(kvp)};
}

double ExposureControl::water_g_cm2(const Technique& now, double measured_kev) const {
  double thin = 0, thick = 100;
  constexpr int kHalvings = 30;  // to 1e-7 g/cm2
  for (int i = 0; i < kHalvings; ++i) {
    const double middle = 0.5 * (thin + thick);
    (signal_(now.kvp, middle) * now.mas > measured_kev ? thin : thick) = middle;
  }
  return 0.5 * (thin + thick);
}

Technique ExposureControl::next(const Technique& now, double measured_kev) const {
  constexpr double kSteady = 0.03;
  if (std::abs(measured_kev - target_kev_) < kSteady * target_kev_) return now;
  return technique_for(water_g_cm2(now, measured_kev));
}

}  // namespace xraycast
