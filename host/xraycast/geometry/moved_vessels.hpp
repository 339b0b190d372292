#pragma once

#include "xraycast/geometry/mesh.hpp"
#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/motion/motion.hpp"

#include <cstdint>
#include <string>
#include <vector>

namespace xraycast {

/// Points of vessels that have no place in the moved body, because the motion folds; they stay where they
/// were.
struct LostPoints {
  std::int64_t lost = 0, of = 0;

  /// What to say of them, with `name` in front; nothing where there are none.
  std::vector<std::string> notes(const std::string& name) const;
};

/// Vessels of a scan in the moved body.
template <typename Vessels>
struct MovedVessels {
  Vessels vessels;
  LostPoints lost;
};

/// A tree whose points are where HeldMotion::inverse_mm finds them. A vessel is stretched as the body is, as
/// in the moved scan: its cross-section grows by the volume's growth over that of the length, the mean of all
/// directions across it. Throws InputError where points coincide after the move.
MovedVessels<VesselTree> moved(const VesselTree& tree, const HeldMotion& motion);

/// A surface of which each corner is where HeldMotion::inverse_mm finds it.
MovedVessels<Mesh> moved(Mesh mesh, const HeldMotion& motion);

}  // namespace xraycast
