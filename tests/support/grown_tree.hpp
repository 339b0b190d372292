#pragma once

#include "xraycast/mask/mask.hpp"
#include "xraycast/volume/volume.hpp"

#include <glm/vec3.hpp>

#include <cstdint>
#include <vector>

namespace xraycast {

/// How a random tree grows.
struct GrownTreeOptions {
  std::uint32_t seed = 1;
  int ends = 120;           ///< how many branches end in tissue
  double end_radius = 0.5;  ///< voxels; a parent's cube is the sum of its children's (Murray's law)
  double bend = 0;          ///< how far a branch bows out, as a share of its length
  double noise = 60;        ///< standard deviation; lumen has 255
  double blur = 0;          ///< standard deviation of a Gaussian before noise, voxels
};

/// A tree in a cube of 100 voxels as VascuSynth makes them (Hamarneh and Jassi, VascuSynth: simulating
/// vascular trees for generating volumetric image data, 2010): the lumen's share of each voxel times 255,
/// blurred, plus noise, cut off at 0 and 255.
struct GrownTree {
  Volume noisy;
  Mask lumen;                          ///< voxels that hold some of it (a fourteenth or more)
  double lumen_voxels = 0;             ///< its volume
  std::vector<glm::dvec3> centreline;  ///< half a voxel apart
};

/// Grows one: each new end lies away from the tree so far and forks off the branch that is nearest. The same
/// on every machine.
GrownTree grow_tree(const GrownTreeOptions& options);

}  // namespace xraycast
