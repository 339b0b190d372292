#pragma once

#include "xraycast/catheter/hub.hpp"
#include "xraycast/catheter/lumen_distance_field.hpp"
#include "xraycast/catheter/vessel_entry.hpp"
#include "xraycast/catheter/wall_contact.hpp"
#include "xraycast/mechanics/rod.hpp"

#include <memory>

namespace xraycast {

/// The straight sheath outside the tree through which devices enter: its length.
inline constexpr double kIntroducer_mm = 20;

/// How far an instrument can be inserted: its length beyond the introducer.
inline double max_insertion_mm(const InstrumentModel& instrument) {
  return instrument.length_mm() - kIntroducer_mm;
}

/// The hub moves no faster than a hand; a pose further ahead is approached at these speeds. Against a larger
/// force than the last one an instrument buckles outside the introducer or slips through the fingers.
struct HubLimits {
  double speed_mm_s = 0, speed_rad_s = 0, push_N = 0;
};

/// A hub on its way to a pose.
struct MovingHub {
  HubPose pose;
  bool is_held = false;  ///< it does not advance, because of the force

  void approach(const HubPose& target, double force_N, double max_insertion_mm, double step_s,
                const HubLimits& limits);
};

/// Where devices are fed in: the introducer's outer end.
Rod::Clamp clamp_at(const VesselEnd& entry);

/// The vessels around devices that enter there; the vessel goes on around the introducer.
std::shared_ptr<const LumenDistanceField> lumen_with_introducer(const VesselTree& tree,
                                                                const VesselEnd& entry);

/// Those walls around a rod. The introducer holds the rod unless it lies in another one.
std::unique_ptr<WallContact> walls_around(std::shared_ptr<const LumenDistanceField> field, const Rod& rod,
                                          const VesselEnd& entry, double stiffness_N_mm2, bool is_outermost);

}  // namespace xraycast
