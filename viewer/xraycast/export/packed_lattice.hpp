#pragma once

#include "xraycast/base/progress.hpp"
#include "xraycast/motion/motion.hpp"

#include <glm/vec3.hpp>

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace xraycast {

/// How places of the body move, ready to be deflated: where nodes of a grid go that are about the places, at
/// key phases of each mode. It is trilinear between nodes and a spline over the phases, as in MovingPoints.
struct PackedLattice {
  /// The grid's; a whole number of clusters of a page's corners (web/src/mesh.ts).
  static constexpr double kSpacing_mm = 8;
  static constexpr double kUnit_mm = 1.0 / 64;

  std::array<std::int64_t, 3> first{};  ///< of the grid's nodes, whose places are multiples of the spacing
  std::array<std::int64_t, 3> size{};   ///< nodes along x, y and z; those of the cells with places are there
  std::size_t nodes = 0;                ///< that are there
  std::vector<std::vector<double>> phases{};  ///< of each mode, ascending
  /// Numbers of the nodes in the grid, x fastest, as differences from the one before.
  std::string numbers{};
  /// Of each key, the last mode's phases fastest, of x, y and z, of each node: in units, the difference from
  /// the same of the key before.
  std::string ways{};
};

/// `places_mm` are in the scan. Stage "moving" of `progress`.
PackedLattice pack_lattice(std::span<const glm::vec3> places_mm, const Motion& motion, Progress& progress);

}  // namespace xraycast
