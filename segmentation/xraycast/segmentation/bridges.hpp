#pragma once

#include "xraycast/base/progress.hpp"
#include "xraycast/mask/mask.hpp"

namespace xraycast {

/// Joins parts of a vessel where something that touches it was taken off together with it, as bone is where a
/// vessel passes through: along the shortest way within `candidates` (all that could be vessel), which keeps
/// to the middle where it can. A way is at most 40 mm long, which an artery's bony canal does not exceed (the
/// carotid's has 25 to 35 mm), and at most twice as long as the parts that it joins. No two parts are joined
/// twice, so that no loops arise. The bridge is as thick as the candidates there, but no thicker than 5 mm.
/// A stage of `progress`.
void bridge_gaps(Mask& mask, const Mask& candidates, Progress& progress);
inline void bridge_gaps(Mask& mask, const Mask& candidates) {
  Progress unheard;
  bridge_gaps(mask, candidates, unheard);
}

}  // namespace xraycast
