#pragma once

#include "xraycast/casting/basis.hpp"
#include "xraycast/casting/key_maps.hpp"
#include "xraycast/casting/spectral_scan.hpp"
#include "xraycast/motion/key_phases.hpp"
#include "xraycast/volume/body_outline.hpp"

#include <glm/vec3.hpp>

#include <memory>
#include <vector>

namespace xraycast {

/// The distance of the nodes on which displacements are kept while rays pass through a scan.
inline constexpr double kFieldSpacing_mm = 8;

/// How much a displacement must change between two keys, at some node of a slice, to make other rows.
inline constexpr double kSameDisplacement_mm = 0.05;

/// Where the skin of a body goes in its keys, LPS mm: of every third voxel of the skin that `finder` has
/// found, and only where it moves.
std::vector<glm::dvec3> moved_skin_mm(const OutlineFinder& finder, const VolumeGeometry& scan,
                                      const Motion& motion, const KeyPhases& phases);

/// Casts a map at each key of a motion, through the displacement and without making the moved scan: see
/// `cast` of caster.hpp. Rows in which no displacement changes between a key and its base are not cast again
/// (of a cylinder in whole bricks). The map's own values are those at phase 0. A stage "casting" of
/// `progress`.
///
/// Throws InputError as `cast` does.
CastResult cast_keys(const SpectralScan& scan, const MapGeometry& geometry, const Attenuation& attenuation,
                     const Motion& motion, const KeyPhases& phases, Progress& progress);

/// The basis of the same maps: see make_basis. A stage "weighing" of `progress`.
Basis make_key_basis(const ResidentScan& scan, const MapGeometry& geometry, std::vector<double> knots_hu,
                     const Motion& motion, const KeyPhases& phases, Progress& progress);

}  // namespace xraycast
