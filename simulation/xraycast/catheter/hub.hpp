#pragma once

namespace xraycast {

/// The pose of the hub, the catheter's outer end, which the hand holds.
struct HubPose {
  double insertion_mm = 0;  ///< length fed through the introducer; positive into the body
  double rotation_rad = 0;  ///< about the direction of insertion, right-handed; adds up over whole turns
};

/// Force and torque on the hand at the hub, in SI units.
struct HubLoad {
  double force_N = 0;    ///< along the hub's axis; positive pushes the hand back, out of the body
  double torque_Nm = 0;  ///< about the direction of insertion; positive resists a positive rotation
};

}  // namespace xraycast
