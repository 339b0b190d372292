#include "xraycast/segmentation/centreline.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/parallel.hpp"
#include "xraycast/mask/distance_transform.hpp"
#include "xraycast/mask/skeleton_graph.hpp"
#include "xraycast/mask/thinning.hpp"
#include "xraycast/mask/trilinear.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <numeric>
#include <optional>

namespace xraycast {
namespace {

using Line = std::vector<glm::dvec3>;

template <typename Point, typename Position = std::identity>
double length_mm(const std::vector<Point>& line, Position position = {}) {
  double sum = 0;
  for (std::size_t i = 1; i < line.size(); ++i)
    sum += glm::distance(std::invoke(position, line[i - 1]), std::invoke(position, line[i]));
  return sum;
}

// ---- the lumen between voxels ---------------------------------------------------------------------------

/// A mask and its distance transform, interpolated linearly.
class Lumen {
 public:
  explicit Lumen(const Mask& mask) : mask_(mask), distance_mm_(distance_to_outside_mm(mask)) {
    const glm::dvec3 s = mask.geometry.spacing_mm;
    voxel_mm_ = std::min({s.x, s.y, s.z});
    coarsest_mm_ = std::max({s.x, s.y, s.z});
  }

  double voxel_mm() const { return voxel_mm_; }
  double coarsest_mm() const { return coarsest_mm_; }

  /// Whether a point lies between the grid's voxel centres.
  bool contains(const glm::dvec3& p) const {
    const glm::dvec3 at = mask_.geometry.to_index(p), last(mask_.geometry.size - Index3(1));
    return at.x >= 0 && at.y >= 0 && at.z >= 0 && at.x <= last.x && at.y <= last.y && at.z <= last.z;
  }

  /// Distance from a point to the lumen's wall; half a voxel less than to the next voxel outside.
  double wall_mm(const glm::dvec3& p) const {
    return std::max(0.5 * voxel_mm_, interpolate(distance_mm_, p) - 0.5 * voxel_mm_);
  }

  /// From 1 inside to 0 outside; the wall is at one half.
  double inside(const glm::dvec3& p) const { return interpolate(mask_.voxels, p); }

 private:
  template <typename T>
  double interpolate(const std::vector<T>& values, const glm::dvec3& world_mm) const {
    const Index3 size = mask_.geometry.size;
    const glm::dvec3 at =
        glm::clamp(mask_.geometry.to_index(world_mm), glm::dvec3(0), glm::dvec3(size - Index3(1)));
    const Index3 low(glm::min(glm::floor(at), glm::dvec3(glm::max(size - Index3(2), Index3(0)))));
    return trilinear(mask_, values, low, at - glm::dvec3(low));
  }

  const Mask& mask_;
  std::vector<float> distance_mm_;
  double voxel_mm_, coarsest_mm_;
};

/// What a plane across a vessel shows of its lumen.
struct CrossSection {
  glm::dvec3 to_middle_mm{0, 0, 0};  ///< from the point to the middle of what the rays reach
  double radius_mm = 0;              ///< the median of the rays
};

/// Sends rays to the wall in the plane across `tangent`. None goes farther beyond the inscribed sphere than a
/// voxel: where a branch leaves there is no wall to be met.
CrossSection cross_section(const Lumen& lumen, const glm::dvec3& point_mm, const glm::dvec3& tangent) {
  constexpr int kRays = 24;
  const glm::dvec3 helper = std::abs(tangent.z) < 0.8 ? glm::dvec3(0, 0, 1) : glm::dvec3(1, 0, 0);
  const glm::dvec3 u = glm::normalize(glm::cross(tangent, helper)), v = glm::cross(tangent, u);
  const double wall_mm = lumen.wall_mm(point_mm), step_mm = 0.2 * lumen.voxel_mm(),
               first_mm = std::max(0.0, wall_mm - 1.5 * lumen.coarsest_mm()),
               last_mm = wall_mm + 1.5 * lumen.coarsest_mm();
  std::array<double, kRays> reach_mm{};
  CrossSection section;
  for (int k = 0; k < kRays; ++k) {
    const double angle = 2 * std::numbers::pi * k / kRays;
    const glm::dvec3 ray = std::cos(angle) * u + std::sin(angle) * v;
    double mm = first_mm, before = lumen.inside(point_mm + mm * ray);
    while (mm < last_mm && before > 0.5) {
      const double here = lumen.inside(point_mm + (mm + step_mm) * ray);
      if (here <= 0.5) {
        mm += step_mm * (before - 0.5) / (before - here);
        break;
      }
      mm += step_mm;
      before = here;
    }
    reach_mm[static_cast<std::size_t>(k)] = mm;
    section.to_middle_mm += 2.0 / kRays * mm * ray;
  }
  std::ranges::nth_element(reach_mm, reach_mm.begin() + kRays / 2);
  section.radius_mm = reach_mm[kRays / 2];
  return section;
}

// ---- the graph becomes a forest without spurs -----------------------------------------------------------

/// A skeleton's graph from which edges can be taken.
class Pruner {
 public:
  Pruner(SkeletonGraph graph, const Lumen& lumen) : graph_(std::move(graph)), lumen_(lumen) {
    gone_.resize(graph_.edges.size());
  }

  void run() {
    cut_loops_open();
    join_all();
    prune_spurs();
    merge_forks();
  }

  /// What is left.
  SkeletonGraph result() const {
    SkeletonGraph kept;
    kept.nodes.resize(graph_.nodes.size());
    for (std::size_t n = 0; n < graph_.nodes.size(); ++n)
      kept.nodes[n].position_mm = graph_.nodes[n].position_mm;
    for (std::size_t e = 0; e < graph_.edges.size(); ++e) {
      if (gone_[e]) continue;
      for (const int node : graph_.edges[e].nodes)
        kept.nodes[static_cast<std::size_t>(node)].edges.push_back(static_cast<int>(kept.edges.size()));
      kept.edges.push_back(graph_.edges[e]);
    }
    return kept;
  }

 private:
  SkeletonGraph::Edge& edge(int e) { return graph_.edges[static_cast<std::size_t>(e)]; }
  SkeletonGraph::Node& node(int n) { return graph_.nodes[static_cast<std::size_t>(n)]; }
  double reach_mm(int n) { return lumen_.wall_mm(node(n).position_mm); }

  double thickness_mm(const SkeletonGraph::Edge& e) const {
    double sum = 0;
    for (const glm::dvec3& p : e.points_mm) sum += lumen_.wall_mm(p);
    return sum / static_cast<double>(e.points_mm.size());
  }

  void remove(int e) {
    gone_[static_cast<std::size_t>(e)] = true;
    for (const int n : edge(e).nodes) std::erase(node(n).edges, e);
  }

  /// The thickest edges span the forest (Kruskal); each other one ends a voxel before its second node. Those
  /// that are shorter than the lumen's circumference only run around a hole in the mask, and go.
  void cut_loops_open() {
    std::vector<int> order;
    for (int e = 0; e < static_cast<int>(graph_.edges.size()); ++e)
      if (!gone_[static_cast<std::size_t>(e)]) order.push_back(e);
    std::vector<double> thickness(graph_.edges.size());
    for (const int e : order) thickness[static_cast<std::size_t>(e)] = thickness_mm(edge(e));
    std::ranges::stable_sort(order, [&](int a, int b) {
      return thickness[static_cast<std::size_t>(a)] > thickness[static_cast<std::size_t>(b)];
    });
    std::vector<int> parent(graph_.nodes.size());
    std::iota(parent.begin(), parent.end(), 0);
    const auto find = [&](int n) {
      while (parent[static_cast<std::size_t>(n)] != n)
        n = parent[static_cast<std::size_t>(n)] =
            parent[static_cast<std::size_t>(parent[static_cast<std::size_t>(n)])];
      return n;
    };
    for (const int e : order) {
      const int a = find(edge(e).nodes[0]), b = find(edge(e).nodes[1]);
      if (a != b) {
        parent[static_cast<std::size_t>(a)] = b;
        continue;
      }
      const int end = edge(e).nodes[1];
      if (length_mm(edge(e).points_mm) <
          2 * std::numbers::pi * std::max(reach_mm(edge(e).nodes[0]), reach_mm(end))) {
        remove(e);
        continue;
      }
      Line& points_mm = edge(e).points_mm;
      if (edge(e).nodes[0] == end)
        std::erase(node(end).edges, e), node(end).edges.push_back(e);
      else
        std::erase(node(end).edges, e);
      points_mm.pop_back();
      if (points_mm.size() < 2) {
        gone_[static_cast<std::size_t>(e)] = true;
        std::erase(node(edge(e).nodes[0]).edges, e);
        continue;
      }
      edge(e).closes_loop = true;
      edge(e).nodes[1] = static_cast<int>(graph_.nodes.size());
      graph_.nodes.push_back({points_mm.back(), {e}});
    }
  }

  /// Takes leaves off while their tip lies in the sphere around the place where they leave, or hardly out of
  /// it, the least far out first; what parted there is then one edge.
  void prune_spurs() {
    for (;;) {
      int worst = -1;
      double worst_mm = 0;
      for (int e = 0; e < static_cast<int>(graph_.edges.size()); ++e) {
        if (gone_[static_cast<std::size_t>(e)]) continue;
        const bool first_is_leaf = node(edge(e).nodes[0]).edges.size() == 1,
                   second_is_leaf = node(edge(e).nodes[1]).edges.size() == 1;
        if (first_is_leaf == second_is_leaf) continue;  // inner edges, and one that is alone
        const int fork = edge(e).nodes[first_is_leaf ? 1 : 0], tip = edge(e).nodes[first_is_leaf ? 0 : 1];
        const double out_mm =
            length_mm(edge(e).points_mm) - reach_mm(fork) - std::max(2 * lumen_.coarsest_mm(), reach_mm(tip));
        if (out_mm < worst_mm) worst = e, worst_mm = out_mm;
      }
      if (worst < 0) return;
      const auto nodes = edge(worst).nodes;
      remove(worst);
      for (const int n : nodes) join(n);
    }
  }

  /// Two forks that lie within half a radius of each other are one, where more than two branches leave.
  void merge_forks() {
    for (int e = 0; e < static_cast<int>(graph_.edges.size()); ++e) {
      if (gone_[static_cast<std::size_t>(e)]) continue;
      const auto [a, b] = edge(e).nodes;
      if (a == b || node(a).edges.size() < 3 || node(b).edges.size() < 3) continue;
      if (length_mm(edge(e).points_mm) > 0.5 * std::min(reach_mm(a), reach_mm(b))) continue;
      remove(e);
      for (const int moved : node(b).edges) {
        SkeletonGraph::Edge& other = edge(moved);
        const bool starts_here = other.nodes[0] == b;
        other.nodes[starts_here ? 0 : 1] = a;
        (starts_here ? other.points_mm.front() : other.points_mm.back()) = node(a).position_mm;
        node(a).edges.push_back(moved);
      }
      node(b).edges.clear();
    }
  }

  void join_all() {
    for (int n = 0; n < static_cast<int>(graph_.nodes.size()); ++n) join(n);
  }

  /// Two edges that meet in a node of their own become one.
  void join(int n) {
    if (node(n).edges.size() != 2 || node(n).edges[0] == node(n).edges[1]) return;
    const int a = node(n).edges[0], b = node(n).edges[1];
    if (edge(a).is_outside || edge(b).is_outside) return;
    if (edge(a).nodes[1] != n) {
      std::ranges::reverse(edge(a).points_mm);
      std::swap(edge(a).nodes[0], edge(a).nodes[1]);
    }
    if (edge(b).nodes[0] != n) {
      std::ranges::reverse(edge(b).points_mm);
      std::swap(edge(b).nodes[0], edge(b).nodes[1]);
    }
    edge(a).points_mm.insert(edge(a).points_mm.end(), edge(b).points_mm.begin() + 1, edge(b).points_mm.end());
    edge(a).closes_loop |= edge(b).closes_loop;
    const int end = edge(b).nodes[1];
    edge(a).nodes[1] = end;
    std::ranges::replace(node(end).edges, b, a);
    node(n).edges.clear();
    gone_[static_cast<std::size_t>(b)] = true;
  }

  SkeletonGraph graph_;
  const Lumen& lumen_;
  std::vector<bool> gone_;
};

// ---- lines between voxels -------------------------------------------------------------------------------

Line resampled(const Line& line, double step_mm) {
  const double total_mm = length_mm(line);
  const int steps = std::max(1, static_cast<int>(std::ceil(total_mm / step_mm)));
  Line result{line.front()};
  double passed_mm = 0;
  std::size_t i = 1;
  for (int k = 1; k < steps; ++k) {
    const double target_mm = total_mm * k / steps;
    while (i + 1 < line.size() && passed_mm + glm::distance(line[i - 1], line[i]) < target_mm) {
      passed_mm += glm::distance(line[i - 1], line[i]);
      ++i;
    }
    const double piece_mm = glm::distance(line[i - 1], line[i]);
    result.push_back(glm::mix(line[i - 1], line[i], piece_mm > 0 ? (target_mm - passed_mm) / piece_mm : 0.0));
  }
  result.push_back(line.back());
  return result;
}

/// Gaussian smoothing of evenly spaced values; the ends stay, and near them the kernel shrinks with the way
/// to the end, so that they pull nothing.
template <typename T>
std::vector<T> smoothed(const std::vector<T>& values, double sigma) {
  std::vector<T> result = values;
  const auto count = static_cast<int>(values.size());
  for (int i = 1; i + 1 < count; ++i) {
    const int reach = std::min({i, count - 1 - i, static_cast<int>(std::ceil(3 * sigma))});
    T sum{};
    double weights = 0;
    for (int k = -reach; k <= reach; ++k) {
      const double weight = std::exp(-0.5 * k * k / (sigma * sigma));
      const int at = i + k;
      sum += weight * values[static_cast<std::size_t>(at)];
      weights += weight;
    }
    result[static_cast<std::size_t>(i)] = sum / weights;
  }
  return result;
}

glm::dvec3 tangent_at(const Line& line, std::size_t i, std::size_t reach) {
  const std::size_t before = i >= reach ? i - reach : 0, after = std::min(i + reach, line.size() - 1);
  const glm::dvec3 along = line[after] - line[before];
  const double length = glm::length(along);
  return length > 0 ? along / length : glm::dvec3(0, 0, 1);
}

/// Lets a line end where the last sphere of its vessel's radius fits: voxels on the way out through the end
/// are taken off, and missing ones added along the line's direction. Its last point is the free end.
void fit_end(Line& line, const Lumen& lumen, double step_mm) {
  constexpr std::size_t kTangentReach = 6;
  const std::size_t inner = line.size() - 1 - std::min(line.size() - 1, 2 * kTangentReach);
  const double radius_mm = lumen.wall_mm(line[inner]),
               least_mm = radius_mm - 0.2 * lumen.voxel_mm();  // what voxels can tell
  // A vessel as thin as a voxel has the least distance to a wall that there is, beyond its end as well.
  const auto fits = [&](const glm::dvec3& p) {
    return lumen.contains(p) && lumen.inside(p) > 0.5 && lumen.wall_mm(p) >= least_mm;
  };
  const auto most = static_cast<std::size_t>(std::ceil(radius_mm / step_mm));
  std::size_t taken = 0;
  while (taken < most && line.size() > inner + 2 && line.size() > 3 && !fits(line.back()))
    line.pop_back(), ++taken;
  if (taken > 0) return;
  const glm::dvec3 along =
      tangent_at(line, line.size() - 1 - std::min(line.size() - 1, kTangentReach), kTangentReach);
  for (std::size_t added = 0; added < 2 * most && fits(line.back() + step_mm * along); ++added)
    line.push_back(line.back() + step_mm * along);
}

/// Which ends of a line may be moved; where it meets others it stays.
struct FreeEnds {
  bool first, last;
};

/// A line in the middle of the lumen, its points `step_mm` apart.
Line centred(const Line& voxels_mm, FreeEnds free, const Lumen& lumen, double step_mm) {
  constexpr std::size_t kTangentReach = 6;
  Line line = smoothed(resampled(voxels_mm, step_mm), 1.5 * lumen.coarsest_mm() / step_mm);
  for (int pass = 0; pass < 3; ++pass) {
    Line moved = line;
    for (std::size_t i = free.first ? 0 : 1; i < line.size() - (free.last ? 0 : 1); ++i) {
      const glm::dvec3 shift = cross_section(lumen, line[i], tangent_at(line, i, kTangentReach)).to_middle_mm;
      const double length = glm::length(shift), most_mm = 0.5 * lumen.voxel_mm();
      moved[i] += length > most_mm ? shift * (most_mm / length) : shift;
    }
    line = resampled(smoothed(moved, 1.5 * lumen.coarsest_mm() / step_mm), step_mm);
  }
  if (free.last) fit_end(line, lumen, step_mm);
  if (free.first) {
    std::ranges::reverse(line);
    fit_end(line, lumen, step_mm);
    std::ranges::reverse(line);
  }
  return line;
}

std::vector<VesselPoint> with_radii(const Line& line, const Lumen& lumen, double step_mm) {
  constexpr std::size_t kTangentReach = 4;
  std::vector<double> radii_mm;
  for (std::size_t i = 0; i < line.size(); ++i)
    radii_mm.push_back(std::max(0.5 * lumen.voxel_mm(),
                                cross_section(lumen, line[i], tangent_at(line, i, kTangentReach)).radius_mm));
  radii_mm = smoothed(radii_mm, 2 * lumen.coarsest_mm() / step_mm);
  std::vector<VesselPoint> points;
  for (std::size_t i = 0; i < line.size(); ++i) points.push_back({line[i], radii_mm[i]});
  return points;
}

/// Within the sphere of the node that it starts from a branch has the radius that it shows outside of it.
void clear_of_parent(std::vector<VesselPoint>& points, double node_radius_mm) {
  std::size_t out = 0;
  while (out < points.size() &&
         glm::distance(points[out].position_mm, points.front().position_mm) < 1.2 * node_radius_mm)
    ++out;
  if (out >= points.size()) out = points.size() - 1;
  for (std::size_t i = 0; i < out; ++i)
    points[i].radius_mm = std::min(points[i].radius_mm, points[out].radius_mm);
}

/// Walks the graph from its root and lays every branch from its parent's side onwards.
class TreeBuilder {
 public:
  TreeBuilder(const SkeletonGraph& graph, const Lumen& lumen, Progress& progress)
      : graph_(graph), lumen_(lumen), lines_(graph.edges.size()) {
    progress.begin("centrelines", static_cast<std::int64_t>(graph.edges.size()), "branches");
    parallel_for(static_cast<std::int64_t>(graph.edges.size()), [&](std::int64_t e) {
      const SkeletonGraph::Edge& edge = graph.edges[static_cast<std::size_t>(e)];
      const auto is_free = [&](int n) { return graph.nodes[static_cast<std::size_t>(n)].edges.size() == 1; };
      const FreeEnds free{is_free(edge.nodes[0]), is_free(edge.nodes[1])};
      lines_[static_cast<std::size_t>(e)] =
          with_radii(centred(edge.points_mm, free, lumen, step_mm()), lumen, step_mm());
      progress.advance();
    });
  }

  Centrelines build(const std::optional<glm::dvec3>& root_mm, const std::string& name) {
    const auto nearness = [&](const FreeEnd& end) { return -glm::distance(end.position_mm, *root_mm); };
    const auto width = [](const FreeEnd& end) {
      return end.length_mm > 2 * end.radius_mm ? end.radius_mm : -1 / end.radius_mm;
    };
    walk(root_mm ? best_end(nearness) : best_end(width));
    VesselTree tree(std::move(branches_), name);
    return {std::move(tree), std::move(loops_), {}, 0};
  }

 private:
  double step_mm() const { return 0.75 * lumen_.voxel_mm(); }

  struct FreeEnd {
    glm::dvec3 position_mm;
    double radius_mm;  ///< somewhat away from the end, which may be cut obliquely
    double length_mm;  ///< of its vessel, to where that branches
  };

  FreeEnd free_end(int node, int edge) const {
    const auto& line = lines_[static_cast<std::size_t>(edge)];
    const bool forwards = graph_.edges[static_cast<std::size_t>(edge)].nodes[0] == node;
    const std::size_t in = line.size() / 4;
    return {(forwards ? line.front() : line.back()).position_mm,
            line[forwards ? in : line.size() - 1 - in].radius_mm, length_mm(line, &VesselPoint::position_mm)};
  }

  /// The node of the free end whose rank is highest.
  template <typename Rank>
  int best_end(const Rank& rank) const {
    int best = -1;
    double highest = 0;
    for (int n = 0; n < static_cast<int>(graph_.nodes.size()); ++n) {
      const auto& edges = graph_.nodes[static_cast<std::size_t>(n)].edges;
      if (edges.size() != 1) continue;
      const double its = rank(free_end(n, edges[0]));
      if (best < 0 || its > highest) best = n, highest = its;
    }
    return best;
  }

  void walk(int root) {
    struct Step {
      int node, edge, parent;
    };
    std::vector<Step> waiting;
    const auto leave = [&](int n, int from_edge, int parent) {
      for (const int e : graph_.nodes[static_cast<std::size_t>(n)].edges)
        if (e != from_edge) waiting.push_back({n, e, parent});
    };
    leave(root, -1, -1);
    while (!waiting.empty()) {
      const auto [n, e, parent] = waiting.back();
      waiting.pop_back();
      const SkeletonGraph::Edge& edge = graph_.edges[static_cast<std::size_t>(e)];
      std::vector<VesselPoint> points = std::move(lines_[static_cast<std::size_t>(e)]);
      if (edge.nodes[0] != n) std::ranges::reverse(points);
      if (parent >= 0) {
        points.front().position_mm = branches_[static_cast<std::size_t>(parent)].points.back().position_mm;
        clear_of_parent(points, branches_[static_cast<std::size_t>(parent)].points.back().radius_mm);
      }
      const auto self = static_cast<int>(branches_.size());
      if (edge.closes_loop) loops_.push_back(self);
      branches_.push_back({std::move(points), parent, {}, {}});
      leave(edge.nodes[edge.nodes[0] == n ? 1 : 0], e, self);
    }
  }

  const SkeletonGraph& graph_;
  const Lumen& lumen_;
  std::vector<std::vector<VesselPoint>> lines_;
  std::vector<VesselBranch> branches_;
  std::vector<int> loops_;
};

/// The face of a grid that lies within a distance of a voxel: 0 to 5, or -1.
int face_within(const VolumeGeometry& grid, const Index3& voxel, double reach_mm) {
  for (int axis = 0; axis < 3; ++axis) {
    const double to_first = static_cast<double>(voxel[axis]),
                 to_last = static_cast<double>(grid.size[axis] - 1 - voxel[axis]);
    if (to_first * grid.spacing_mm[axis] <= reach_mm) return 2 * axis;
    if (to_last * grid.spacing_mm[axis] <= reach_mm) return 2 * axis + 1;
  }
  return -1;
}

}  // namespace

Centrelines find_centrelines(const Mask& mask, const std::string& name, Progress& progress,
                             const std::optional<glm::dvec3>& root_mm) {
  const Box box = grown(bounding_box(mask), 2, mask.geometry.size);
  if (box.empty()) throw InputError("{}: no vessel: the mask is empty", name);
  const Mask part = crop(mask, box);
  Mask skeleton = thin(part, progress);
  const Lumen lumen(part);
  const auto [joins, left_out] = join_parts(skeleton, [&](const Index3& end) {
    const double reach_mm = lumen.wall_mm(part.geometry.to_world_mm(glm::dvec3(end))) + lumen.coarsest_mm();
    return face_within(mask.geometry, end + box.lower, reach_mm);
  });
  for (const PartJoin& join : joins)
    if (!join.is_outside) draw(join, skeleton);
  SkeletonGraph traced = trace(skeleton);
  for (const PartJoin& join : joins)
    if (join.is_outside) add_edge(join, part.geometry, traced);
  std::vector<double> gaps_mm;
  for (const PartJoin& join : joins) gaps_mm.push_back(join.length_mm);
  Pruner pruner(std::move(traced), lumen);
  pruner.run();
  const SkeletonGraph graph = pruner.result();
  if (graph.edges.empty())
    throw InputError("{}: no vessel: nothing in the mask is longer than it is wide", name);
  Centrelines found = TreeBuilder(graph, lumen, progress).build(root_mm, name);
  found.gaps_mm = std::move(gaps_mm);
  found.parts_left_out = left_out;
  return found;
}

}  // namespace xraycast
