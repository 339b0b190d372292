#include "xraycast/catheter/hub.hpp"

#include <algorithm>

namespace xraycast {

void MovingHub::approach(const HubPose& target, double force_N, const HubPose& largest, double step_s) {
  const double max_move_mm = kMaxSpeed_mm_s * step_s, max_rotation_rad = kMaxSpeed_rad_s * step_s;
  const double target_mm = std::clamp(target.insertion_mm, 0.0, largest.insertion_mm);
  is_held = target_mm > pose.insertion_mm && force_N > kMaxPush_N;
  pose.insertion_mm += std::clamp(target_mm - pose.insertion_mm, -max_move_mm, is_held ? 0 : max_move_mm);
  pose.rotation_rad +=
      std::clamp(target.rotation_rad - pose.rotation_rad, -max_rotation_rad, max_rotation_rad);
  const double max_change_bar = kMaxInflation_bar_s * step_s;
  const double target_bar = std::clamp(target.inflation_bar, 0.0, largest.inflation_bar);
  pose.inflation_bar += std::clamp(target_bar - pose.inflation_bar, -max_change_bar, max_change_bar);
  const double release_mm = std::min(target.release_mm, largest.release_mm);
  pose.release_mm += std::clamp(release_mm - pose.release_mm, 0.0, kMaxRelease_mm_s * step_s);
  pose.detach = std::max(pose.detach, std::min(target.detach, largest.detach));
}

}  // namespace xraycast
