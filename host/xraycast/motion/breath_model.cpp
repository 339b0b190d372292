#include "xraycast/motion/breath_model.hpp"

#include "xraycast/motion/monotone_profile.hpp"

#include <glm/common.hpp>

#include <algorithm>

namespace xraycast::breath_model {

std::vector<std::pair<double, double>> waveform() {
  constexpr double kInspired_s = 1.5, kExpired_s = 3, kSample_s = 0.25;
  std::vector<std::pair<double, double>> samples;
  for (double time_s = 0; time_s <= kPeriod_s; time_s += kSample_s) {
    const double share = time_s < kInspired_s
                             ? time_s / kInspired_s
                             : std::max(kExpired_s - time_s, 0.0) / (kExpired_s - kInspired_s);
    samples.emplace_back(time_s, glm::smoothstep(0.0, 1.0, share));
  }
  return samples;
}

double model_height_mm(double height_mm, double lung_mm) {
  constexpr double kLung_mm = 186;
  return height_mm > 0 ? height_mm * kLung_mm / lung_mm : height_mm;
}

double organ_share(double height_mm) {
  static const MonotoneProfile share({{-331, 0},
                                      {-256, 0.22},
                                      {-186, 0.55},
                                      {-126, 0.78},
                                      {-76, 0.95},
                                      {-36, 1},
                                      {0, 1},
                                      {54, 0.6},
                                      {104, 0.27},
                                      {154, 0.05},
                                      {186, 0}});
  return share(height_mm);
}

double mediastinal_share(double height_mm) {
  static const MonotoneProfile share({{-26, 0.6}, {24, 0.42}, {69, 0.26}, {109, 0.1}, {154, 0}});
  return share(height_mm);
}

double wall_mm(double height_mm) {
  static const MonotoneProfile forwards({{-331, 0},
                                         {-256, 2.5},
                                         {-166, 6},
                                         {-106, 6.5},
                                         {-46, 5},
                                         {4, 3.5},
                                         {64, 3},
                                         {114, 2.2},
                                         {159, 0.5},
                                         {186, 0}});
  return forwards(height_mm);
}

double forwards_share(double from_hinge) {
  const double t = std::clamp(from_hinge, 0.0, 1.0);
  return t * t * t * (4 - 3 * t);
}

}  // namespace xraycast::breath_model
