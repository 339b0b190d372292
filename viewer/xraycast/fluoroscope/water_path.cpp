#include "xraycast/fluoroscope/water_path.hpp"

#include "xraycast/base/error.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace xraycast {
namespace {

/// Linear through the points, and beyond the last as between the last two.
double interpolated(const std::vector<double>& from, const std::vector<double>& to, double at) {
  const auto after = std::upper_bound(from.begin(), from.end(), at);
  const std::size_t i = std::clamp<std::ptrdiff_t>(after - from.begin(), 1, std::ssize(from) - 1);
  return std::lerp(to[i - 1], to[i], (at - from[i - 1]) / (from[i] - from[i - 1]));
}

}  // namespace

double water_per_mm(const Opacity& opacity) {
  constexpr double kPaper_per_mm = 0.02;
  const double in_map = opacity.mu_per_mm(0);
  return in_map > 0 ? in_map : kPaper_per_mm;
}

WaterPath::WaterPath(double water_per_mm) {
  constexpr double kG_cm2_per_mm = 0.1;
  tau_ = {0, water_per_mm};
  g_cm2_ = {0, kG_cm2_per_mm};
}

WaterPath::WaterPath(const Opacity& opacity) : WaterPath(water_per_mm(opacity)) {}

WaterPath::WaterPath(const Spectrum& spectrum) {
  const SpectrumModel model(spectrum, std::span(kMaterials).first(1));
  constexpr int kMost_g_cm2 = 150;
  for (int g_cm2 = 0; g_cm2 <= kMost_g_cm2; ++g_cm2) {
    const double tau = -std::log(model.transmission(std::array{1.0 * g_cm2}));
    if (!std::isfinite(tau) || (g_cm2 > 0 && tau <= tau_.back())) break;
    tau_.push_back(tau);
    g_cm2_.push_back(g_cm2);
  }
  if (tau_.size() < 2)
    throw InputError("{}: a centimetre of water lets nothing of this spectrum through; give a harder one",
                     spectrum.name());
}

WaterPath::WaterPath(const Attenuation& attenuation)
    : WaterPath(std::visit([](const auto& one) { return WaterPath(one); }, attenuation)) {}

double WaterPath::g_cm2(double tau) const { return std::max(0.0, interpolated(tau_, g_cm2_, tau)); }

}  // namespace xraycast
