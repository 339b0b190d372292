#include "xraycast/scene/vessel_pick.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <limits>

namespace xraycast {
namespace {

struct Ray {
  glm::dvec3 start_mm, direction;  ///< towards the detector
};

Ray ray_of(const View& view, const glm::dvec2& pixel) {
  const glm::dvec3 on_detector = view.pixel_on_detector_mm(pixel.x - 0.5, pixel.y - 0.5);
  if (!view.cone) return {on_detector, view.towards_detector()};
  return {view.source_mm(), glm::normalize(on_detector - view.source_mm())};
}

/// Between which distances along a ray the tree lies, and its widest radius.
struct Reach {
  double from_mm = std::numeric_limits<double>::infinity(), to_mm = -from_mm, radius_mm = 0;
};

Reach reach_of(const VesselTree& tree, const Ray& ray) {
  Reach reach;
  for (const VesselBranch& branch : tree.branches())
    for (const VesselPoint& point : branch.points) {
      const double along_mm = glm::dot(point.position_mm - ray.start_mm, ray.direction);
      reach.from_mm = std::min(reach.from_mm, along_mm - point.radius_mm);
      reach.to_mm = std::max(reach.to_mm, along_mm + point.radius_mm);
      reach.radius_mm = std::max(reach.radius_mm, point.radius_mm);
    }
  return reach;
}

/// The mean along the branch.
double mean_radius_mm(const VesselBranch& branch) {
  double sum = 0;
  for (std::size_t i = 1; i < branch.points.size(); ++i)
    sum += 0.5 * (branch.points[i - 1].radius_mm + branch.points[i].radius_mm) *
           (branch.arc_length_mm[i] - branch.arc_length_mm[i - 1]);
  return sum / branch.arc_length_mm.back();
}

}  // namespace

std::optional<VesselTree::Location> vessel_at(const VesselTree& tree, const View& view,
                                              const glm::dvec2& pixel) {
  constexpr double kShortestStep_mm = 0.2, kBeside_px = 4;
  const Ray ray = ray_of(view, pixel);
  const Reach reach = reach_of(tree, ray);
  const double at_axis = view.cone ? view.cone->source_axis_mm / view.cone->source_detector_mm : 1;
  double least_gap_mm = kBeside_px * view.pixel_mm * at_axis;
  std::optional<VesselTree::Location> beside;
  for (double t_mm = reach.to_mm; t_mm >= reach.from_mm;) {
    const glm::dvec3 point_mm = ray.start_mm + t_mm * ray.direction;
    const VesselTree::Location place = tree.nearest(point_mm);
    if (tree.inside(point_mm)) return place;
    if (const double gap_mm = place.distance_mm - place.radius_mm; gap_mm < least_gap_mm) {
      least_gap_mm = gap_mm;
      beside = place;
    }
    // No wall is nearer than the nearest centreline less the widest radius.
    t_mm -= std::max(kShortestStep_mm, place.distance_mm - reach.radius_mm);
  }
  return beside;
}

std::string describe(const VesselTree& tree, const VesselTree::Location& place) {
  const VesselBranch& branch = tree.branches()[static_cast<std::size_t>(place.branch)];
  std::string text =
      fmt::format("{}, {:.0f} of {:.0f} mm, radius {:.1f} mm (mean {:.1f})", tree.title(place.branch),
                  place.arc_length_mm, branch.arc_length_mm.back(), place.radius_mm, mean_radius_mm(branch));
  if (branch.parent >= 0) text += fmt::format(", from {}", tree.title(branch.parent));
  if (branch.children.empty()) return text;
  std::vector<std::string> children;
  for (const int child : branch.children) {
    const std::string& name = tree.branches()[static_cast<std::size_t>(child)].name;
    children.push_back(name.empty() ? fmt::format("{}", child) : name);
  }
  text += fmt::format(", into {}", fmt::join(children, ", "));
  return text;
}

}  // namespace xraycast
