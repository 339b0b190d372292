#pragma once

#include "xraycast/base/progress.hpp"
#include "xraycast/mask/mask.hpp"

namespace xraycast {

/// Whether a voxel can be taken from an object without changing its topology: seen from there the object has
/// one 26-connected part and the outside one 6-connected part (Bertrand and Malandain, A new characterization
/// of three-dimensional simple points, 1994). Bit i of `neighbourhood` is neighbour i of kNeighbours.
bool is_simple(std::uint32_t neighbourhood);

/// Thins a mask to lines one voxel wide in the middle of what is there, in six directional passes a layer
/// (Lee, Kashyap and Chu, Building skeleton models via 3-D medial surface/axis thinning algorithms, 1994).
/// Only simple voxels go, one after the other, so that parts, tunnels and cavities, and with them the Euler
/// characteristic, all stay. Ends of lines stay too.
/// `progress` counts the voxels that went; they end some way before its total.
Mask thin(const Mask& mask, Progress& progress);
inline Mask thin(const Mask& mask) {
  Progress unheard;
  return thin(mask, unheard);
}

}  // namespace xraycast
