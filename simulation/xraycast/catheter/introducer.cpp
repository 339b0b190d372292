#include "xraycast/catheter/introducer.hpp"

#include <Eigen/Geometry>
#include <algorithm>

namespace xraycast {

void MovingHub::approach(const HubPose& target, double force_N, double max_insertion_mm, double step_s,
                         const HubLimits& limits) {
  const double max_move_mm = limits.speed_mm_s * step_s, max_rotation_rad = limits.speed_rad_s * step_s;
  const double target_mm = std::clamp(target.insertion_mm, 0.0, max_insertion_mm);
  const double rotation_rad = pose.rotation_rad + std::clamp(target.rotation_rad - pose.rotation_rad,
                                                             -max_rotation_rad, max_rotation_rad);
  is_held = target_mm > pose.insertion_mm && force_N > limits.push_N;
  pose.insertion_mm += std::clamp(target_mm - pose.insertion_mm, -max_move_mm, is_held ? 0 : max_move_mm);
  pose.rotation_rad = rotation_rad;
}

Rod::Clamp clamp_at(const VesselEnd& entry) {
  const Eigen::Vector3d axis = -entry.outward;
  return {.position_mm = entry.position_mm + kIntroducer_mm * entry.outward,
          .axis = axis,
          .m1 = axis.unitOrthogonal()};
}

std::shared_ptr<const LumenDistanceField> lumen_with_introducer(const VesselTree& tree,
                                                                const VesselEnd& entry) {
  // The vessel goes on around the introducer and a little further.
  constexpr double kOpening_mm = kIntroducer_mm + 10;
  return std::make_shared<LumenDistanceField>(tree, &entry, kOpening_mm);
}

std::unique_ptr<WallContact> walls_around(std::shared_ptr<const LumenDistanceField> field, const Rod& rod,
                                          const VesselEnd& entry, double stiffness_N_mm2, bool is_outermost) {
  const InstrumentModel& instrument = rod.instrument();
  std::optional<WallContact::Introducer> introducer;
  if (is_outermost) introducer = {entry.position_mm, -entry.outward};
  return std::make_unique<WallContact>(
      std::move(field), rod,
      WallContact::Options{.stiffness_N_mm2 = stiffness_N_mm2,
                           .tangential_N_mm2 = stiffness_N_mm2,
                           .static_friction = instrument.static_friction(),
                           .kinetic_friction = instrument.kinetic_friction()},
      introducer);
}

}  // namespace xraycast
