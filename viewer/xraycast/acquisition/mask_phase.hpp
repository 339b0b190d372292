#pragma once

#include "xraycast/motion/body_request.hpp"

#include <cstddef>
#include <optional>
#include <string>

namespace xraycast {

/// At which phase of a moving body a mask is taken.
struct MaskPhase {
  /// A mode and its phase; none: matched, each exposure has the mask of its own phase of the heart, or of the
  /// first mode where there is no heart, as cardiac units do.
  std::optional<PhaseGate> fixed{};
};

/// `matched`, or `heart=0.75`. Throws InputError with the field `mask_phase` in front.
MaskPhase parse_mask_phase(const std::string& text);

/// How masks are found by the phase of one mode.
struct MaskMatching {
  std::size_t mode = 0;           ///< its number in the motion
  bool wraps = true;              ///< phases 0 and 1 are the same
  std::optional<double> phase{};  ///< of all masks; none: that of the exposure
  double cycle_s = 1;             ///< in which the mode has all its phases, of the motion's time
};

/// Throws InputError with the field `mask_phase` in front for a mode that the motion does not have, and a
/// phase beyond 0 to 1.
MaskMatching matching_of(const MaskPhase& wanted, const Motion& motion);

}  // namespace xraycast
