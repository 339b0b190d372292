#include "xraycast/vessel_names/artery_names.hpp"

#include "xraycast/geometry/branch_names.hpp"

#include <fmt/format.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <optional>

namespace xraycast {
namespace {

/// A branch as it is walked along, away from where one comes.
struct Course {
  int branch;
  bool is_forwards;
};

/// The tree as a graph: blood may come from either side of a branch.
class VesselGraph {
 public:
  explicit VesselGraph(const VesselTree& tree) : tree_(tree) {}

  const VesselBranch& branch(int i) const { return tree_.branches()[static_cast<std::size_t>(i)]; }
  int size() const { return static_cast<int>(tree_.branches().size()); }

  glm::dvec3 start_mm(Course way) const { return end_point(way, !way.is_forwards).position_mm; }
  glm::dvec3 end_mm(Course way) const { return end_point(way, way.is_forwards).position_mm; }
  double length_mm(Course way) const { return branch(way.branch).arc_length_mm.back(); }

  /// The median along the branch.
  double radius_mm(Course way) const {
    std::vector<double> radii;
    for (const VesselPoint& point : branch(way.branch).points) radii.push_back(point.radius_mm);
    std::ranges::nth_element(radii, radii.begin() + std::ssize(radii) / 2);
    return radii[radii.size() / 2];
  }

  /// The place at a distance along a branch from its start, or its end where it is shorter.
  glm::dvec3 at_mm(Course way, double arc_mm) const {
    return point_at(branch(way.branch), way.is_forwards ? arc_mm : length_mm(way) - arc_mm).position_mm;
  }

  /// The branches that go on where one ends.
  std::vector<Course> onwards(Course way) const {
    std::vector<Course> next;
    const VesselBranch& of = branch(way.branch);
    if (way.is_forwards) {
      for (const int child : of.children) next.push_back({child, true});
    } else if (of.parent >= 0) {
      next.push_back({of.parent, false});
      for (const int child : branch(of.parent).children)
        if (child != way.branch) next.push_back({child, true});
    }
    return next;
  }

  /// What lies beyond the start of a branch, it included: points for which a function is told.
  void each_point(Course way, const std::function<void(const glm::dvec3&)>& visit) const {
    std::vector<Course> waiting{way};
    while (!waiting.empty()) {
      const Course at = waiting.back();
      waiting.pop_back();
      for (const VesselPoint& point : branch(at.branch).points) visit(point.position_mm);
      const std::vector<Course> next = onwards(at);
      waiting.insert(waiting.end(), next.begin(), next.end());
    }
  }

 private:
  const VesselPoint& end_point(Course way, bool last) const {
    return last ? branch(way.branch).points.back() : branch(way.branch).points.front();
  }

  const VesselTree& tree_;
};

/// A vessel: branches one behind the other, where only twigs leave.
using Vessel = std::vector<Course>;

constexpr double kTwig = 0.55;  ///< of the radius of what goes on beside it

/// The box of what lies beyond the start of a branch.
struct Extent {
  glm::dvec3 low_mm{std::numeric_limits<double>::infinity()}, high_mm{-low_mm};
};

Extent extent_of(const VesselGraph& graph, Course way) {
  Extent extent;
  graph.each_point(way, [&](const glm::dvec3& p) {
    extent.low_mm = glm::min(extent.low_mm, p);
    extent.high_mm = glm::max(extent.high_mm, p);
  });
  return extent;
}

class ArteryNaming {
 public:
  explicit ArteryNaming(const VesselTree& tree) : graph_(tree), names_(tree.branches().size()) {}

  std::vector<std::string> names() {
    find_aorta();
    if (aorta_.empty()) return std::move(names_);
    const bool has_arch = name_arch();
    const bool has_front = name_visceral_arteries();
    if (!has_arch && !has_front) return std::vector<std::string>(names_.size());
    name_iliac_arteries();
    name(aorta_, "aorta");
    return std::move(names_);
  }

 private:
  void name(const Vessel& vessel, const std::string& words) {
    for (const Course& way : vessel) names_[index(way)] = words;
  }
  static std::size_t index(Course way) { return static_cast<std::size_t>(way.branch); }

  // ---- ways through the tree ----------------------------------------------------------------------------

  /// The widest of some branches.
  std::optional<Course> widest(const std::vector<Course>& ways) const {
    if (ways.empty()) return {};
    return *std::ranges::max_element(ways, {}, [&](Course way) { return graph_.radius_mm(way); });
  }

  /// The widest, and those that are no twigs beside it.
  std::vector<Course> limbs(std::vector<Course> ways) const {
    if (const auto main = widest(ways))
      std::erase_if(ways, [&](Course way) {
        return way.branch != main->branch && (graph_.radius_mm(way) < kTwig * graph_.radius_mm(*main) ||
                                              length_with_rest_mm(way) < 2 * graph_.radius_mm(way));
      });
    return ways;
  }

  /// From a branch's start to the farthest place beyond it, in a straight line.
  double length_with_rest_mm(Course way) const {
    double farthest_mm = 0;
    const glm::dvec3 from = graph_.start_mm(way);
    graph_.each_point(
        way, [&](const glm::dvec3& p) { farthest_mm = std::max(farthest_mm, glm::distance(p, from)); });
    return farthest_mm;
  }

  /// A branch and those that go on from it, up to where the vessel splits into two of its kind or ends.
  Vessel vessel_from(Course first) const {
    Vessel vessel{first};
    for (;;) {
      const std::vector<Course> next = limbs(graph_.onwards(vessel.back()));
      if (next.size() != 1) return vessel;
      vessel.push_back(next.front());
    }
  }

  /// The same, along the widest branches as long as they are nearly as wide as those before.
  Vessel wide_way(Course first) const {
    constexpr double kAsWide = 0.68;
    Vessel way{first};
    double radius_mm = graph_.radius_mm(first);
    while (const auto next = widest(graph_.onwards(way.back()))) {
      if (graph_.radius_mm(*next) < kAsWide * radius_mm) break;
      way.push_back(*next);
      if (graph_.length_mm(*next) > radius_mm) radius_mm = graph_.radius_mm(*next);
    }
    return way;
  }

  glm::dvec3 end_mm(const Vessel& vessel) const { return graph_.end_mm(vessel.back()); }

  // ---- the aorta ----------------------------------------------------------------------------------------

  /// From the heart, or the scan's upper end, to where it splits.
  void find_aorta() {
    constexpr double kLeastRadius_mm = 5, kMostRadius_mm = 40, kLeastFall_mm = 80, kAcross = 0.6;
    std::optional<Course> seed;
    for (int i = 0; i < graph_.size(); ++i) {
      const Course way{i, true};
      const double radius_mm = graph_.radius_mm(way);
      if (radius_mm < kLeastRadius_mm || radius_mm > kMostRadius_mm || graph_.length_mm(way) < radius_mm)
        continue;
      if (!seed || radius_mm > graph_.radius_mm(*seed)) seed = way;
    }
    if (!seed) return;
    Vessel way = wide_way({seed->branch, false});
    std::ranges::reverse(way);
    for (Course& course : way) course.is_forwards = !course.is_forwards;
    way.pop_back();
    const Vessel rest = wide_way(*seed);
    way.insert(way.end(), rest.begin(), rest.end());
    if (graph_.end_mm(way.back()).z > graph_.start_mm(way.front()).z) {
      std::ranges::reverse(way);
      for (Course& course : way) course.is_forwards = !course.is_forwards;
    }
    double top_mm = -std::numeric_limits<double>::infinity(), length_mm = 0;
    for (const Course& course : way) {
      length_mm += graph_.length_mm(course);
      for (const VesselPoint& point : graph_.branch(course.branch).points)
        top_mm = std::max(top_mm, point.position_mm.z);
    }
    const double rise_mm = top_mm - graph_.start_mm(way.front()).z,
                 fall_mm = top_mm - graph_.end_mm(way.back()).z;
    if (fall_mm < kLeastFall_mm || fall_mm + rise_mm < kAcross * length_mm) return;
    aorta_ = std::move(way);
    top_mm_ = top_mm;
    has_arch_ = rise_mm > 2 * graph_.radius_mm(aorta_.front());
  }

  /// A side branch, and where it leaves.
  struct Side {
    Course way;
    glm::dvec3 from_mm;
    std::size_t after;  ///< the piece of the aorta at whose end it leaves
  };

  /// Those along the aorta, in the order of its blood, without twigs of noise.
  std::vector<Side> sides() const {
    constexpr double kLeastRadius_mm = 1.2, kLeastReach_mm = 15;
    std::vector<Side> found;
    for (std::size_t i = 0; i + 1 < aorta_.size(); ++i)
      for (const Course& way : graph_.onwards(aorta_[i]))
        if (way.branch != aorta_[i + 1].branch && graph_.radius_mm(way) >= kLeastRadius_mm &&
            length_with_rest_mm(way) >= kLeastReach_mm)
          found.push_back({way, graph_.start_mm(way), i});
    return found;
  }

  // ---- the arch -----------------------------------------------------------------------------------------

  /// The three vessels of the arch; true where they are there.
  bool name_arch() {
    constexpr double kArch_mm = 60, kLeastRise_mm = 25, kLeastAside_mm = 30;
    if (!has_arch_) return false;
    std::vector<Side> upwards;
    for (const Side& side : sides())
      if (side.from_mm.z > top_mm_ - kArch_mm &&
          extent_of(graph_, side.way).high_mm.z > side.from_mm.z + kLeastRise_mm)
        upwards.push_back(side);
    if (upwards.size() != 3) return false;
    const Extent first = extent_of(graph_, upwards[0].way), last = extent_of(graph_, upwards[2].way);
    const double right_mm = upwards[0].from_mm.x - first.low_mm.x,
                 left_mm = last.high_mm.x - upwards[2].from_mm.x;
    const bool goes_right = right_mm > kLeastAside_mm, goes_left = left_mm > kLeastAside_mm;
    if (!goes_right || !goes_left) return false;
    name(vessel_from(upwards[1].way), "left common carotid artery");
    name(vessel_from(upwards[2].way), "left subclavian artery");
    const Vessel trunk = vessel_from(upwards[0].way);
    name(trunk, "brachiocephalic trunk");
    name_right_arch(trunk);
    return true;
  }

  void name_right_arch(const Vessel& trunk) {
    constexpr double kApart_mm = 25;
    std::vector<Course> both = limbs(graph_.onwards(trunk.back()));
    if (both.size() != 2) return;
    std::ranges::sort(both, {}, [&](Course way) { return extent_of(graph_, way).low_mm.x; });
    const Extent aside = extent_of(graph_, both[0]), upwards = extent_of(graph_, both[1]);
    if (aside.low_mm.x > upwards.low_mm.x - kApart_mm || upwards.high_mm.z < aside.high_mm.z) return;
    name(vessel_from(both[0]), "right subclavian artery");
    name(vessel_from(both[1]), "right common carotid artery");
  }

  // ---- the abdomen --------------------------------------------------------------------------------------

  /// Where a branch has gone after some millimetres, from where it leaves.
  glm::dvec3 heading_mm(const Side& side) const {
    constexpr double kAlong_mm = 25;
    double left_mm = kAlong_mm;
    for (const Course& way : vessel_from(side.way)) {
      if (graph_.length_mm(way) >= left_mm) return graph_.at_mm(way, left_mm) - side.from_mm;
      left_mm -= graph_.length_mm(way);
    }
    return end_mm(vessel_from(side.way)) - side.from_mm;
  }

  bool leaves_to_the_front(const Side& side) const {
    const glm::dvec3 to = heading_mm(side);
    return -to.y > std::abs(to.x) && -to.y > 4;
  }

  /// The coeliac trunk, the superior mesenteric artery and the renal arteries; true where one of the first
  /// two is there.
  bool name_visceral_arteries() {
    constexpr double kLeastBelow_mm = 60, kLeastFall_mm = 50, kTogether_mm = 60;
    std::vector<Side> front, aside;
    for (const Side& side : sides()) {
      if (has_arch_ && side.from_mm.z > top_mm_ - kLeastBelow_mm) continue;
      if (is_renal(side))
        aside.push_back(side);
      else
        front.push_back(side);
    }
    const auto is_coeliac = [&](const Side& side) { return coeliac_limbs(side).has_value(); };
    const auto is_mesenteric = [&](const Side& side) {
      const glm::dvec3 end = end_mm(vessel_from(side.way));
      return leaves_to_the_front(side) && end.z < side.from_mm.z - kLeastFall_mm &&
             end.y < side.from_mm.y - 5;
    };
    const auto coeliac = only(front, is_coeliac), mesenteric = only(front, is_mesenteric);
    if (coeliac && mesenteric &&
        (coeliac->from_mm.z < mesenteric->from_mm.z ||
         coeliac->from_mm.z > mesenteric->from_mm.z + kTogether_mm))
      return false;
    if (coeliac) {
      const auto [hepatic, splenic] = *coeliac_limbs(*coeliac);
      name(vessel_from(coeliac->way), "coeliac trunk");
      name(vessel_from(hepatic), "common hepatic artery");
      name(vessel_from(splenic), "splenic artery");
    }
    if (mesenteric) name(vessel_from(mesenteric->way), "superior mesenteric artery");
    if (mesenteric || coeliac) {
      const double above_mm = mesenteric ? mesenteric->from_mm.z : coeliac->from_mm.z;
      name_renal(aside, -1, above_mm, "right renal artery");
      name_renal(aside, 1, above_mm, "left renal artery");
    }
    return coeliac || mesenteric;
  }

  /// The one that fits, if there is but one.
  static std::optional<Side> only(const std::vector<Side>& sides,
                                  const std::function<bool(const Side&)>& fits) {
    std::optional<Side> found;
    for (const Side& side : sides) {
      if (!fits(side)) continue;
      if (found) return {};
      found = side;
    }
    return found;
  }

  /// The limbs to the patient's right and left, if a branch is short and splits so.
  std::optional<std::array<Course, 2>> coeliac_limbs(const Side& side) const {
    constexpr double kLongestTrunk_mm = 50, kLeastAside_mm = 25;
    const Vessel trunk = vessel_from(side.way);
    double length_mm = 0;
    for (const Course& way : trunk) length_mm += graph_.length_mm(way);
    std::vector<Course> both = limbs(graph_.onwards(trunk.back()));
    if (length_mm > kLongestTrunk_mm || both.size() != 2 || end_mm(trunk).y > side.from_mm.y - 4) return {};
    const auto end_x = [&](Course way) { return end_mm(vessel_from(way)).x; };
    std::ranges::sort(both, {}, end_x);
    if (end_x(both[0]) > side.from_mm.x - kLeastAside_mm || end_x(both[1]) < side.from_mm.x + kLeastAside_mm)
      return {};
    return std::array{both[0], both[1]};
  }

  /// To the side and not down: to a kidney.
  bool is_renal(const Side& side) const {
    constexpr double kLeastAside_mm = 25, kLeastRadius_mm = 1.6;
    const glm::dvec3 to = end_mm(vessel_from(side.way)) - side.from_mm, heading = heading_mm(side);
    return std::abs(to.x) > kLeastAside_mm && std::abs(to.z) < 0.8 * std::abs(to.x) && heading.x * to.x > 0 &&
           std::abs(heading.x) > -heading.y && to.y > -std::abs(to.x) / 3 &&
           graph_.radius_mm(side.way) >= kLeastRadius_mm;
  }

  /// The widest of one side, a little below a place.
  void name_renal(const std::vector<Side>& aside, double sign, double above_mm, const char* words) {
    constexpr double kLowest_mm = 60, kHighest_mm = 15;
    std::vector<Course> fitting;
    for (const Side& side : aside) {
      const double below_mm = above_mm - side.from_mm.z;
      if (sign * (end_mm(vessel_from(side.way)).x - side.from_mm.x) > 0 && below_mm > -kHighest_mm &&
          below_mm < kLowest_mm)
        fitting.push_back(side.way);
    }
    if (const auto main = widest(fitting)) name(vessel_from(*main), words);
  }

  void name_iliac_arteries() {
    constexpr double kLeastFall_mm = 30, kLeastApart_mm = 25;
    std::vector<Course> both = limbs(graph_.onwards(aorta_.back()));
    if (both.size() != 2) return;
    const auto end = [&](Course way) { return end_mm(vessel_from(way)); };
    std::ranges::sort(both, {}, [&](Course way) { return end(way).x; });
    const double from_z = end_mm(aorta_).z;
    if (end(both[1]).x - end(both[0]).x < kLeastApart_mm || end(both[0]).z > from_z - kLeastFall_mm ||
        end(both[1]).z > from_z - kLeastFall_mm)
      return;
    name_iliac(both[0], "right");
    name_iliac(both[1], "left");
  }

  void name_iliac(Course first, const std::string& side) {
    constexpr double kApart_mm = 15;
    const Vessel common = vessel_from(first);
    std::vector<Course> both = limbs(graph_.onwards(common.back()));
    const auto end_y = [&](Course way) { return end_mm(vessel_from(way)).y; };
    if (both.size() == 2) std::ranges::sort(both, {}, end_y);
    if (both.size() != 2 || end_y(both[1]) - end_y(both[0]) < kApart_mm)
      return name(common, side + " iliac artery");
    name(common, side + " common iliac artery");
    name(vessel_from(both[0]), side + " external iliac artery");
    name(vessel_from(both[1]), side + " internal iliac artery");
  }

  VesselGraph graph_;
  std::vector<std::string> names_;
  Vessel aorta_;
  double top_mm_ = 0;
  bool has_arch_ = false;
};

}  // namespace

std::vector<std::string> artery_names(const VesselTree& tree) { return ArteryNaming(tree).names(); }

VesselTree with_artery_names(const VesselTree& tree) {
  const bool has_names =
      std::ranges::any_of(tree.branches(), [](const VesselBranch& b) { return !b.name.empty(); });
  return has_names ? tree : with_branch_names(tree, artery_names(tree));
}

}  // namespace xraycast
