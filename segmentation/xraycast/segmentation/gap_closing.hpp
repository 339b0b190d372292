#pragma once

#include "xraycast/base/progress.hpp"
#include "xraycast/mask/mask.hpp"

namespace xraycast {

/// Closes the gaps of a vessel where the removal of a touching structure took a stretch of it, as of bone
/// that a vessel passes through: along the geodesic path within `candidates` (all voxels that could be
/// vessel), whose cost is higher near their wall. A path is at most 40 mm long, which an artery's bony canal
/// does not exceed (the carotid's has 25 to 35 mm), and at most twice as long as the components that it
/// joins. The paths are the minimum spanning forest of the components, so that no loops arise. They are as
/// thick as the candidates there, but no thicker than 5 mm. A stage of `progress`.
void close_gaps(Mask& mask, const Mask& candidates, Progress& progress);
inline void close_gaps(Mask& mask, const Mask& candidates) {
  Progress unheard;
  close_gaps(mask, candidates, unheard);
}

}  // namespace xraycast
