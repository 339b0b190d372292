#pragma once

#include "xraycast/geometry/vessel_tree.hpp"

#include <span>
#include <string>
#include <vector>

namespace xraycast {

/// A smooth curve through control points (centripetal Catmull-Rom, radii too), sampled every `step_mm` or
/// closer; the control points themselves are kept. Two or more controls.
std::vector<VesselPoint> smooth_curve(std::span<const VesselPoint> controls, double step_mm);

/// The course of a vessel: a smooth curve through control points.
struct VesselCourse {
  std::string name;
  int parent = -1;                    ///< index of the vessel that it leaves; -1 for the root
  std::size_t leaves_at = 0;          ///< the control point of its parent at which it begins
  double first_radius_mm = 0;         ///< its own radius there, inside the parent
  std::vector<VesselPoint> controls;  ///< without the point on its parent; two or more of the root, else one
};

/// The courses in a file of phantom/data/, parents before their children:
/// {"vessels": [{"name", "parent" (a name; none for the root), "leaves_at", "first_radius", "points":
/// [[x, y, z, radius], ...]}, ...]}, in LPS millimetres.
///
/// They follow `earlier`, those of another file, on which their parents may be.
std::vector<VesselCourse> vessel_courses(const std::string& file, std::vector<VesselCourse> earlier = {});

/// The tree of vessels with these courses, ready for VesselTree's constructor: every vessel is cut into
/// branches at the control points where others leave it, which have its name, and begins exactly on its
/// parent. Branches are in the order of the courses, those of one vessel from its beginning onwards.
std::vector<VesselBranch> grow_vessels(std::span<const VesselCourse> courses);

}  // namespace xraycast
