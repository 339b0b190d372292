#pragma once

#include "xraycast/volume/volume.hpp"

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include <string>
#include <vector>

namespace xraycast {

/// A line along the body, such as a vessel's centreline or the spine, that a cylinder map's axis can follow.
class CurvedAxis {
 public:
  /// Two or more points in LPS millimetres, in order. Throws InputError, with `name` in front, when a number
  /// is not finite or z does not strictly rise or fall from point to point.
  CurvedAxis(std::vector<glm::dvec3> points_mm, const std::string& name);

  /// `FILE` is a CSV of x, y, z with or without a heading; `FILE[#BRANCH]` a vessel tree (.vtp or .json), of
  ///   which branch 0 is the default: a branch's number, or a vessel's name. Throws InputError, naming file
  ///   and line.
  static CurvedAxis from_file(const std::string& name);

  /// x, y of the line at a height z; beyond its ends, those of its end points.
  glm::dvec2 at_mm(double z_mm) const;

  /// The centre of every row of a cylinder map of `volume`, the most superior slice first.
  std::vector<glm::dvec2> centre_of_rows_mm(const VolumeGeometry& volume) const;

 private:
  std::vector<glm::dvec3> points_mm_;  ///< z rises
};

}  // namespace xraycast
