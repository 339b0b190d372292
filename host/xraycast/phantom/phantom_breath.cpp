#include "xraycast/motion/breath_model.hpp"
#include "xraycast/phantom/phantom_modes.hpp"
#include "xraycast/phantom/phantom_trunk.hpp"

#include <glm/common.hpp>

#include <cmath>

namespace xraycast {

PhantomMode breath_mode() {
  PhantomMode mode{.name = "breath",
                   .period_s = breath_model::kPeriod_s,
                   .waveform = breath_model::waveform(),
                   .keys = {0, 1}};
  mode.share = [](double phase) { return phase; };
  mode.lower_mm = {-230, -400, -255};
  mode.upper_mm = {230, 110, 262};
  mode.displacement_mm = [body = TrunkRegions(), lower = mode.lower_mm,
                          upper = mode.upper_mm](const glm::dvec3& x) -> glm::dvec3 {
    if (x.z <= lower.z || x.z >= upper.z || x.y >= upper.y) return {0, 0, 0};
    constexpr double kDome_mm = 76, kHinge_mm = 25, kWall_mm = -115, kFlank_mm = 150;
    const double height = x.z - kDome_mm;
    const double dorsal_mm = breath_model::forwards_share((kHinge_mm - x.y) / (kHinge_mm - kWall_mm)) *
                             breath_model::wall_mm(height) *
                             (1 - glm::smoothstep(kFlank_mm, upper.x, std::abs(x.x)));
    // What is close to ribs, spine and the muscles of the back stays; organs and lungs shear along them.
    const double freedom = body.freedom(x);
    if (freedom == 0) return {0, dorsal_mm, 0};
    const double share = glm::mix(breath_model::organ_share(height), breath_model::mediastinal_share(height),
                                  body.mediastinum(x));
    return {0, dorsal_mm, freedom * share * breath_model::kDiaphragm_mm};
  };
  return mode;
}

}  // namespace xraycast
