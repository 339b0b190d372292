#pragma once

#include "xraycast/geometry/mesh.hpp"

#include <cstddef>
#include <string>
#include <vector>

namespace xraycast {

/// Where a surface is open: an inlet or outlet of a vessel, or a hole.
struct Opening {
  glm::dvec3 centre_mm;
  double radius_mm;  ///< of a circle as long as its edge
};

/// A closed surface, and what had to be done to it.
struct RepairedSurface {
  Mesh mesh;
  std::vector<Opening> openings;    ///< closed by triangles to their centres
  std::size_t dropped = 0;          ///< triangles without an area, or there twice
  std::size_t branching_edges = 0;  ///< shared by three triangles or more
  std::size_t pieces = 1;           ///< parts without a common point; they may overlap
  bool was_inside_out = false;

  /// The faults, a line each; `name` precedes it.
  std::vector<std::string> notes(const std::string& name) const;
};

/// Joins points that coincide, leaves out triangles without an area and those that are there twice, closes
/// openings, and turns normals outwards where the whole surface is inside out. Throws InputError, with `name`
/// in front, for a surface without triangles or one that encloses no volume.
RepairedSurface repaired(const Mesh& surface, const std::string& name);

}  // namespace xraycast
