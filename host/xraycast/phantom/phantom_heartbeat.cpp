#include "xraycast/motion/heartbeat_model.hpp"
#include "xraycast/phantom/phantom_modes.hpp"
#include "xraycast/phantom/phantom_trunk.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>

namespace xraycast {

PhantomMode heart_mode() {
  PhantomMode mode{.name = "heart", .period_s = heartbeat_model::kPeriod_s, .keys = heartbeat_model::keys()};
  mode.share = heartbeat_model::contraction;
  // The reach about the long axis, from beyond the apex to the aortic arch.
  mode.lower_mm = {-100, -145, -14};
  mode.upper_mm = {142, 82, 220};
  mode.displacement_mm = [body = TrunkRegions(), heart = heartbeat_model::Heart{kHeartApex_mm, kHeartAxis}](
                             const glm::dvec3& x) -> glm::dvec3 {
    const glm::dvec3 free_mm = heartbeat_model::systole_mm(heart, x);
    if (free_mm == glm::dvec3(0)) return free_mm;
    // The descending aorta, just behind the heart, does not beat along.
    constexpr double kAortaX_mm = 28, kAortaY_mm = 27, kAorta_mm = 12, kFree_mm = 42;
    const double beside_mm = glm::distance(glm::dvec2(x), glm::dvec2(kAortaX_mm, kAortaY_mm));
    return glm::smoothstep(kAorta_mm, kFree_mm, beside_mm) * body.freedom(x) * free_mm;
  };
  return mode;
}

}  // namespace xraycast
