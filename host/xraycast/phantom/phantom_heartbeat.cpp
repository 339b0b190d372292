#include "xraycast/motion/heartbeat_model.hpp"
#include "xraycast/phantom/phantom_modes.hpp"
#include "xraycast/phantom/phantom_trunk.hpp"

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
    return free_mm == glm::dvec3(0) ? free_mm : body.freedom(x) * free_mm;
  };
  return mode;
}

}  // namespace xraycast
