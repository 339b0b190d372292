#include "xraycast/skeleton/junctions.hpp"

#include "xraycast/skeleton/line.hpp"

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

double arc_length_mm(const Points& points) {
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

/// Junctions one behind the other on a vessel, so near each other that between them no line is the vessel's
/// alone, as in the aortic arch.
using JunctionRow = std::vector<Junction>;

/// The vessel that passes junctions as one line.
struct Trunk {
  Points points;
  double radius_mm;  ///< on the first parent's side
  double step_mm;
};

/// Where a side branch begins: at a node on the trunk's line, and with its own points from `outside` on.
struct Start {
  int side;
  std::size_t outside, node;
};

class Straightener {
 public:
  Straightener(std::vector<VesselBranch>& branches, const Lumen* lumen)
      : branches_(branches), lumen_(lumen), is_done_(branches.size()) {}

  void straighten(int parent) {
    if (is_done_[static_cast<std::size_t>(parent)]) return;
    JunctionRow row = row_from(parent);
    // Fewer of them where the row is not straight enough.
    while (!row.empty() && !straighten(row)) row.pop_back();
  }

 private:
  Points& points(int branch) { return branches_[static_cast<std::size_t>(branch)].points; }

  JunctionRow row_from(int parent) {
    JunctionRow row;
    for (std::optional<Junction> next = junction_at(parent); next; next = junction_at(row.back().trunk)) {
      row.push_back(*next);
      const Points& line = points(next->trunk);
      if (arc_length_mm(line) > 2 * kBeyond * line[line.size() / 2].radius_mm) break;
    }
    return row;
  }

  std::optional<Junction> junction_at(int parent) {
    const std::vector<int>& children = branches_[static_cast<std::size_t>(parent)].children;
    if (children.size() < 2) return std::nullopt;
    const auto radius_mm = [&](int child) { return points(child)[points(child).size() / 2].radius_mm; };
    Junction junction{parent, *std::ranges::max_element(children, {}, radius_mm), {}};
    double widest_side_mm = 0;
    for (const int child : children) {
      if (child == junction.trunk) continue;
      junction.sides.push_back(child);
      widest_side_mm = std::max(widest_side_mm, radius_mm(child));
    }
    const Points back(points(parent).rbegin(), points(parent).rend());
    const std::size_t before = index_at(back, beyond_mm(back)),
                      after = index_at(points(junction.trunk), beyond_mm(points(junction.trunk)));
    const double own_mm = back[before].radius_mm, trunk_mm = radius_mm(junction.trunk);
    // Two children nearly as wide as each other part from their parent; none passes. What is much wider than
    // all others passes in a bend as well.
    constexpr double kContinues = 0.6, kAlike = 0.85, kMuchThinner = 0.6, kBend = 0.2;
    if (trunk_mm < kContinues * own_mm || widest_side_mm > kAlike * trunk_mm) return std::nullopt;
    const double straight =
        glm::dot(-direction(back, before, own_mm), direction(points(junction.trunk), after, own_mm));
    if (straight < (widest_side_mm < kMuchThinner * trunk_mm ? kBend : kContinues)) return std::nullopt;
    return junction;
  }

  /// Whether the row could be straightened.
  bool straighten(const JunctionRow& row) {
    const std::optional<Trunk> trunk = passing(row);
    if (!trunk) return false;
    std::vector<std::vector<Start>> starts;
    std::vector<std::size_t> nodes;
    for (const Junction& junction : row) {
      starts.emplace_back();
      std::size_t sum = 0;
      for (const int side : junction.sides) {
        const std::optional<Start> start = start_of(side, points(side), *trunk);
        if (!start) return false;
        starts.back().push_back(*start);
        sum += start->node;
      }
      const std::size_t node = sum / starts.back().size();  // one for all sides
      if (node < (nodes.empty() ? 1 : nodes.back() + 2) || node + 2 > trunk->points.size()) return false;
      nodes.push_back(node);
    }
    nodes.push_back(trunk->points.size() - 1);
    const auto first = trunk->points.begin();
    const auto at = [&](std::size_t node) { return first + static_cast<std::ptrdiff_t>(node); };
    points(row.front().parent).assign(first, at(nodes[0]) + 1);
    for (std::size_t k = 0; k < row.size(); ++k) {
      for (const Start& start : starts[k])
        start_from(trunk->points[nodes[k]], start.outside, trunk->step_mm, points(start.side));
      points(row[k].trunk).assign(at(nodes[k]), at(nodes[k + 1]) + 1);
      is_done_[static_cast<std::size_t>(row[k].parent)] = true;
    }
    return true;
  }

  /// How far back from a junction a line is that of its vessel alone: half of its length at most, since there
  /// may be a junction at its other end.
  static double beyond_mm(const Points& from_junction) {
    const double half_mm = 0.5 * arc_length_mm(from_junction);
    const double radius_mm = from_junction[index_at(from_junction, half_mm)].radius_mm;
    return std::min(kBeyond * radius_mm, half_mm);
  }

  std::optional<Trunk> passing(const JunctionRow& row) {
    Points before(points(row.front().parent).rbegin(), points(row.front().parent).rend());
    const Points& after = points(row.back().trunk);
    const std::size_t a = index_at(before, beyond_mm(before)), b = index_at(after, beyond_mm(after));
    const double radius_mm = before[a].radius_mm,
                 step_mm = arc_length_mm(after) / static_cast<double>(after.size() - 1);
    if (a + 1 >= before.size() || b + 1 >= after.size()) return std::nullopt;
    Trunk trunk{{}, radius_mm, step_mm};
    trunk.points.assign(before.rbegin(), before.rend() - static_cast<std::ptrdiff_t>(a) - 1);
    const Points middle = bridge(before[a], -direction(before, a, radius_mm), after[b],
                                 direction(after, b, radius_mm), step_mm);
    const std::size_t first = trunk.points.size();
    trunk.points.insert(trunk.points.end(), middle.begin(), middle.end());
    trunk.points.insert(trunk.points.end(), after.begin() + static_cast<std::ptrdiff_t>(b), after.end());
    if (lumen_ != nullptr) centre(first, first + middle.size(), trunk);
    if (!is_along(row, trunk, first, first + middle.size())) return std::nullopt;
    return trunk;
  }

  /// Whether a stretch of a trunk, [first, last), stays near the lines that it replaces.
  bool is_along(const JunctionRow& row, const Trunk& trunk, std::size_t first, std::size_t last) {
    constexpr double kFarthest = 0.5;  // radii
    Points old = points(row.front().parent);
    for (const Junction& junction : row)
      old.insert(old.end(), points(junction.trunk).begin(), points(junction.trunk).end());
    return std::all_of(trunk.points.begin() + static_cast<std::ptrdiff_t>(first),
                       trunk.points.begin() + static_cast<std::ptrdiff_t>(last),
                       [&](const VesselPoint& point) {
                         return std::ranges::any_of(old, [&](const VesselPoint& p) {
                           return glm::distance(p.position_mm, point.position_mm) < kFarthest * p.radius_mm;
                         });
                       });
  }

  /// Moves a stretch of a trunk, [first, last), into the middle of the lumen, and takes its radii from there.
  void centre(std::size_t first, std::size_t last, Trunk& trunk) const {
    constexpr int kPasses = 12;
    constexpr double kSmooth_vox = 3;
    const double smooth = kSmooth_vox * lumen_->coarsest_mm() / trunk.step_mm;
    constexpr std::size_t kTangentReach = 6;
    Line line;
    for (const VesselPoint& point : trunk.points) line.push_back(point.position_mm);
    const std::size_t begin = first - 1, end = std::min(last + 1, line.size());  // these two points stay
    for (int pass = 0; pass < kPasses; ++pass) {
      const Line moved = towards_middle(line, first, last, *lumen_);
      const Line stretch(moved.begin() + static_cast<std::ptrdiff_t>(begin),
                         moved.begin() + static_cast<std::ptrdiff_t>(end));
      std::ranges::copy(smoothed(stretch, smooth), line.begin() + static_cast<std::ptrdiff_t>(begin));
    }
    // As wide as the vessel beside its branches, whose openings are less than half of the way around.
    constexpr double kReach = 1.3;
    std::vector<double> radii_mm;
    for (std::size_t i = begin; i < end; ++i)
      radii_mm.push_back(i < first || i >= last
                             ? trunk.points[i].radius_mm
                             : cross_section(*lumen_, line[i], tangent_at(line, i, kTangentReach),
                                             kReach * trunk.points[i].radius_mm)
                                   .radius_mm);
    radii_mm = smoothed(radii_mm, smooth);
    for (std::size_t i = first; i < last; ++i) {
      trunk.points[i].position_mm = line[i];
      trunk.points[i].radius_mm = std::max(radii_mm[i - begin], lumen_->least_radius_mm());
    }
  }

  static std::optional<Start> start_of(int branch, const Points& side, const Trunk& trunk) {
    const std::optional<std::size_t> outside = first_outside(side, trunk);
    if (!outside) return std::nullopt;
    const std::optional<std::size_t> node = meeting(side, *outside, trunk);
    if (!node) return std::nullopt;
    return Start{branch, *outside, *node};
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
  const Lumen* lumen_;
  std::vector<bool> is_done_;  ///< of each branch, its junction with its children
};

}  // namespace

void straighten_junctions(std::vector<VesselBranch>& branches, const Lumen* lumen) {
  Straightener straightener(branches, lumen);
  for (std::size_t i = 0; i < branches.size(); ++i) straightener.straighten(static_cast<int>(i));
}

}  // namespace xraycast
