#include "xraycast/phantom/monotone_profile.hpp"
#include "xraycast/phantom/phantom_modes.hpp"
#include "xraycast/phantom/phantom_trunk.hpp"

#include <glm/common.hpp>

#include <cmath>

namespace xraycast {
namespace {

constexpr double kDiaphragm_mm = 12, kBreath_s = 4;

/// Caudal shares of the diaphragm's excursion by height: of lungs and abdominal organs, and of the
/// mediastinum, whose middle lags behind the domes.
const MonotoneProfile& organ_share() {
  static const MonotoneProfile share({{-255, 0},
                                      {-180, 0.22},
                                      {-110, 0.55},
                                      {-50, 0.78},
                                      {0, 0.95},
                                      {40, 1},
                                      {76, 1},
                                      {130, 0.6},
                                      {180, 0.27},
                                      {230, 0.05},
                                      {262, 0}});
  return share;
}

const MonotoneProfile& mediastinal_share() {
  static const MonotoneProfile share({{50, 0.6}, {100, 0.42}, {145, 0.26}, {185, 0.1}, {230, 0}});
  return share;
}

/// How far the ventral wall moves forwards, by height.
const MonotoneProfile& wall_mm() {
  static const MonotoneProfile forwards({{-255, 0},
                                         {-180, 2.5},
                                         {-90, 6},
                                         {-30, 6.5},
                                         {30, 5},
                                         {80, 3.5},
                                         {140, 3},
                                         {190, 2.2},
                                         {235, 0.5},
                                         {262, 0}});
  return forwards;
}

}  // namespace

PhantomMode breath_mode() {
  PhantomMode mode{.name = "breath", .period_s = kBreath_s, .keys = {0, 1}};
  // In for 1.5 s, out for 1.5 s, and at rest for the last quarter of the breath.
  constexpr double kInspired_s = 1.5, kExpired_s = 3, kSample_s = 0.25;
  for (double time_s = 0; time_s <= kBreath_s; time_s += kSample_s) {
    const double turn = time_s < kInspired_s
                            ? time_s / kInspired_s
                            : std::max(kExpired_s - time_s, 0.0) / (kExpired_s - kInspired_s);
    mode.waveform.emplace_back(time_s, glm::smoothstep(0.0, 1.0, turn));
  }
  mode.share = [](double phase) { return phase; };
  mode.lower_mm = {-230, -400, -255};
  mode.upper_mm = {230, 110, 262};
  mode.displacement_mm = [body = TrunkRegions(), lower = mode.lower_mm,
                          upper = mode.upper_mm](const glm::dvec3& x) -> glm::dvec3 {
    if (x.z <= lower.z || x.z >= upper.z || x.y >= upper.y) return {0, 0, 0};
    // From the front of the spine forwards, and fastest behind the wall.
    constexpr double kHinge_mm = 25, kWall_mm = -115;
    const double t = std::clamp((kHinge_mm - x.y) / (kHinge_mm - kWall_mm), 0.0, 1.0);
    const double dorsal_mm =
        t * t * t * (4 - 3 * t) * wall_mm()(x.z) * (1 - glm::smoothstep(150.0, 230.0, std::abs(x.x)));
    // What is close to ribs, spine and the muscles of the back stays; organs and lungs shear along them.
    const double freedom = body.freedom(x);
    if (freedom == 0) return {0, dorsal_mm, 0};
    const double share = glm::mix(organ_share()(x.z), mediastinal_share()(x.z), body.mediastinum(x));
    return {0, dorsal_mm, freedom * share * kDiaphragm_mm};
  };
  return mode;
}

}  // namespace xraycast
