#include "xraycast/given_vessels/junctions.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <optional>

namespace xraycast {
namespace {

using Points = std::vector<VesselPoint>;

/// How far from a junction, in radii of the vessel that passes it, lines are those of the vessels alone.
constexpr double kBeyond = 1.3;

double length_mm(const Points& points) {
  double sum = 0;
  for (std::size_t i = 1; i < points.size(); ++i)
    sum += glm::distance(points[i - 1].position_mm, points[i].position_mm);
  return sum;
}

/// The first point at an arc length or beyond, not the last one.
std::size_t index_at(const Points& points, double mm) {
  double passed_mm = 0;
  std::size_t i = 0;
  while (i + 2 < points.size() && passed_mm < mm) {
    passed_mm += glm::distance(points[i].position_mm, points[i + 1].position_mm);
    ++i;
  }
  return i;
}

/// The direction of a line over a stretch from a point on; unit length.
glm::dvec3 direction(const Points& points, std::size_t from, double stretch_mm) {
  std::size_t to = from;
  double passed_mm = 0;
  while (to + 1 < points.size() && passed_mm < stretch_mm) {
    passed_mm += glm::distance(points[to].position_mm, points[to + 1].position_mm);
    ++to;
  }
  return glm::normalize(points[to].position_mm - points[from].position_mm);
}

/// A cubic curve between two points, without the last one, its points about `step_mm` apart.
Points bridge(const VesselPoint& a, const glm::dvec3& along_a, const VesselPoint& b,
              const glm::dvec3& along_b, double step_mm) {
  const double chord_mm = glm::distance(a.position_mm, b.position_mm);
  const int count = std::max(1, static_cast<int>(std::ceil(chord_mm / step_mm)));
  Points points;
  for (int k = 0; k < count; ++k) {
    const double t = static_cast<double>(k) / count, t2 = t * t, t3 = t2 * t;
    points.push_back({(2 * t3 - 3 * t2 + 1) * a.position_mm + (t3 - 2 * t2 + t) * chord_mm * along_a +
                          (3 * t2 - 2 * t3) * b.position_mm + (t3 - t2) * chord_mm * along_b,
                      std::lerp(a.radius_mm, b.radius_mm, t)});
  }
  return points;
}

/// A junction: the branch that ends there, the child that continues it, and the others.
struct Junction {
  int parent, trunk;
  std::vector<int> sides;
};

/// The vessel that passes a junction as one line.
struct Trunk {
  Points points;
  double radius_mm;  ///< on the parent's side
  double step_mm;
};

class Straightener {
 public:
  explicit Straightener(std::vector<VesselBranch>& branches) : branches_(branches) {}

  void straighten(int parent) {
    const std::optional<Junction> junction = junction_at(parent);
    if (!junction) return;
    const std::optional<Trunk> trunk = passing(*junction);
    if (!trunk) return;
    // The place on the trunk where the side branches' axes meet it; one node for all.
    struct Start {
      std::size_t outside, node;
    };
    std::vector<Start> starts;
    for (const int side : junction->sides) {
      const std::optional<std::size_t> outside = first_outside(points(side), *trunk);
      if (!outside) return;
      const std::optional<std::size_t> node = meeting(points(side), *outside, *trunk);
      if (!node) return;
      starts.push_back({*outside, *node});
    }
    std::size_t node = 0;
    for (const Start& start : starts) node += start.node;
    node /= starts.size();
    if (node < 1 || node + 2 > trunk->points.size()) return;
    for (std::size_t i = 0; i < starts.size(); ++i)
      start_from(trunk->points[node], starts[i].outside, trunk->step_mm, points(junction->sides[i]));
    const auto cut = trunk->points.begin() + static_cast<std::ptrdiff_t>(node);
    points(parent).assign(trunk->points.begin(), cut + 1);
    points(junction->trunk).assign(cut, trunk->points.end());
  }

 private:
  Points& points(int branch) { return branches_[static_cast<std::size_t>(branch)].points; }

  std::optional<Junction> junction_at(int parent) {
    const std::vector<int>& children = branches_[static_cast<std::size_t>(parent)].children;
    if (children.size() < 2) return std::nullopt;
    const Points back(points(parent).rbegin(), points(parent).rend());
    const double radius_mm = back[index_at(back, beyond_mm(back))].radius_mm;
    const glm::dvec3 onwards = -direction(back, index_at(back, beyond_mm(back)), radius_mm);
    Junction junction{parent, -1, {}};
    double widest_mm = 0;
    for (const int child : children) {
      const Points& line = points(child);
      const std::size_t at = index_at(line, std::min(kBeyond * radius_mm, 0.5 * length_mm(line)));
      constexpr double kContinues = 0.6;  // of the parent's radius, and the cosine of the bend
      if (line[at].radius_mm < std::max(kContinues * radius_mm, widest_mm) ||
          glm::dot(direction(line, at, radius_mm), onwards) < kContinues)
        continue;
      junction.trunk = child;
      widest_mm = line[at].radius_mm;
    }
    if (junction.trunk < 0) return std::nullopt;
    for (const int child : children)
      if (child != junction.trunk) junction.sides.push_back(child);
    // Two children nearly as wide as each other part from their parent; none passes.
    constexpr double kAlike = 0.85;
    for (const int side : junction.sides) {
      const Points& line = points(side);
      if (line[index_at(line, 0.5 * length_mm(line))].radius_mm > kAlike * widest_mm) return std::nullopt;
    }
    return junction;
  }

  /// How far back from a junction a line is that of its vessel alone: half of its length at most, since there
  /// may be a junction at its other end.
  static double beyond_mm(const Points& from_junction) {
    const double half_mm = 0.5 * length_mm(from_junction);
    const double radius_mm = from_junction[index_at(from_junction, half_mm)].radius_mm;
    return std::min(kBeyond * radius_mm, half_mm);
  }

  std::optional<Trunk> passing(const Junction& junction) {
    Points before(points(junction.parent).rbegin(), points(junction.parent).rend());
    const Points& after = points(junction.trunk);
    const std::size_t a = index_at(before, beyond_mm(before)), b = index_at(after, beyond_mm(after));
    const double radius_mm = before[a].radius_mm,
                 step_mm = length_mm(after) / static_cast<double>(after.size() - 1);
    if (a + 1 >= before.size() || b + 1 >= after.size()) return std::nullopt;
    Trunk trunk{{}, radius_mm, step_mm};
    trunk.points.assign(before.rbegin(), before.rend() - static_cast<std::ptrdiff_t>(a) - 1);
    const Points middle = bridge(before[a], -direction(before, a, radius_mm), after[b],
                                 direction(after, b, radius_mm), step_mm);
    trunk.points.insert(trunk.points.end(), middle.begin(), middle.end());
    trunk.points.insert(trunk.points.end(), after.begin() + static_cast<std::ptrdiff_t>(b), after.end());
    return trunk;
  }

  /// The trunk's point nearest to another.
  static std::size_t nearest(const Trunk& trunk, const glm::dvec3& point_mm) {
    const auto found = std::ranges::min_element(
        trunk.points, {}, [&](const VesselPoint& p) { return glm::distance(p.position_mm, point_mm); });
    return static_cast<std::size_t>(found - trunk.points.begin());
  }

  /// The first point of a side branch that lies half its radius beyond the trunk's wall.
  static std::optional<std::size_t> first_outside(const Points& side, const Trunk& trunk) {
    for (std::size_t i = 1; i + 2 < side.size(); ++i) {
      const VesselPoint& wall = trunk.points[nearest(trunk, side[i].position_mm)];
      if (glm::distance(wall.position_mm, side[i].position_mm) > wall.radius_mm + 0.5 * side[i].radius_mm)
        return i;
    }
    return std::nullopt;
  }

  /// The trunk's point that a side branch comes from, if it is straight up to its first point outside.
  static std::optional<std::size_t> meeting(const Points& side, std::size_t outside, const Trunk& trunk) {
    const VesselPoint& from = side[outside];
    const glm::dvec3 back = -direction(side, outside, 2 * from.radius_mm);
    const double reach_mm = 3 * trunk.radius_mm;
    double least_mm = std::numeric_limits<double>::infinity();
    std::size_t best = 0;
    for (std::size_t i = 0; i < trunk.points.size(); ++i) {
      const glm::dvec3 to = trunk.points[i].position_mm - from.position_mm;
      const double along_mm = glm::clamp(glm::dot(to, back), 0.0, reach_mm);
      const double mm = glm::distance(to, along_mm * back);
      if (mm < least_mm) least_mm = mm, best = i;
    }
    if (least_mm > 0.5 * trunk.radius_mm) return std::nullopt;  // it comes from elsewhere
    return best;
  }

  /// Lets a side branch begin at a node of the trunk, and be as it is from a point on.
  static void start_from(const VesselPoint& node, std::size_t outside, double step_mm, Points& side) {
    const VesselPoint first{node.position_mm, side[outside].radius_mm};
    const glm::dvec3 along = direction(side, outside, 2 * side[outside].radius_mm),
                     straight = glm::normalize(side[outside].position_mm - node.position_mm);
    Points line = bridge(first, straight, side[outside], along, step_mm);
    line.insert(line.end(), side.begin() + static_cast<std::ptrdiff_t>(outside), side.end());
    side = std::move(line);
  }

  std::vector<VesselBranch>& branches_;
};

}  // namespace

void straighten_junctions(std::vector<VesselBranch>& branches) {
  Straightener straightener(branches);
  for (std::size_t i = 0; i < branches.size(); ++i) straightener.straighten(static_cast<int>(i));
}

}  // namespace xraycast
