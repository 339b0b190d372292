#include "xraycast/segmentation/centreline.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/parallel.hpp"
#include "xraycast/mask/skeleton_graph.hpp"
#include "xraycast/mask/thinning.hpp"
#include "xraycast/radii/fill_radii.hpp"
#include "xraycast/skeleton/inner_leaves.hpp"
#include "xraycast/skeleton/junctions.hpp"
#include "xraycast/skeleton/line.hpp"
#include "xraycast/skeleton/lumen.hpp"
#include "xraycast/skeleton/skeleton_pruning.hpp"

#include <fmt/format.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>

namespace xraycast {
namespace {

/// The inscribed radius of a vessel, and by how much that at a place may be smaller.
struct EvenRadius {
  double mm, margin_mm;
};

/// That at a point of a line: the median over `reach` points to either side, because the radii of a digital
/// tube vary by half a voxel. Where they vary by more than a voxel, as in the neck of an aneurysm, the
/// point's own.
EvenRadius even_radius(const Line& line, const Lumen& lumen, std::size_t at, std::size_t reach) {
  std::vector<double> radii_mm;
  for (std::size_t i = at - std::min(at, reach); i <= at + reach && i < line.size(); ++i)
    radii_mm.push_back(lumen.inscribed_radius_mm(line[i]));
  std::ranges::sort(radii_mm);
  if (radii_mm.back() - radii_mm.front() > lumen.voxel_mm())
    return {lumen.inscribed_radius_mm(line[at]), 0.2 * lumen.voxel_mm()};
  return {radii_mm[radii_mm.size() / 2], 0.5 * lumen.voxel_mm()};
}

/// Takes off a line's end by what the sphere inscribed there is smaller than its vessel: towards an end,
/// round or flat, that shrinks as fast as one goes.
void take_off_shortfall(Line& line, const Lumen& lumen, double radius_mm) {
  const double piece_mm = glm::distance(line[line.size() - 2], line.back()),
               short_mm = radius_mm - lumen.inscribed_radius_mm(line.back());
  if (short_mm > 0 && short_mm < 0.9 * piece_mm)
    line.back() = glm::mix(line.back(), line[line.size() - 2], short_mm / piece_mm);
}

/// Lets a line end where the last inscribed sphere of its vessel's radius fits: points beyond it are removed,
/// and missing ones extrapolated along the line's direction. Its last point is the free end.
void fit_end(Line& line, const Lumen& lumen, double step_mm) {
  constexpr std::size_t kTangentReach = 6;
  const std::size_t inner = line.size() - 1 - std::min(line.size() - 1, 2 * kTangentReach);
  const auto [radius_mm, margin_mm] = even_radius(line, lumen, inner, kTangentReach);
  // A vessel as thin as a voxel has the least distance to a wall that there is, beyond its end as well.
  const auto fits = [&](const glm::dvec3& p, double min_radius_mm) {
    return lumen.contains(p) && lumen.occupancy(p) > 0.5 && lumen.inscribed_radius_mm(p) >= min_radius_mm;
  };
  const auto max_points = static_cast<std::size_t>(std::ceil(radius_mm / step_mm));
  std::size_t removed = 0;
  while (removed < max_points && line.size() > inner + 2 && line.size() > 3 &&
         !fits(line.back(), radius_mm - margin_mm))
    line.pop_back(), ++removed;
  if (removed > 0) return take_off_shortfall(line, lumen, radius_mm);
  // Noise makes wide ends too: beyond the line only what is as wide as the vessel is taken.
  const double own_mm = lumen.inscribed_radius_mm(line[inner]);
  const glm::dvec3 along =
      tangent_at(line, line.size() - 1 - std::min(line.size() - 1, kTangentReach), kTangentReach);
  for (std::size_t added = 0;
       added < 2 * max_points && fits(line.back() + step_mm * along, own_mm - 0.2 * lumen.voxel_mm());
       ++added)
    line.push_back(line.back() + step_mm * along);
  take_off_shortfall(line, lumen, radius_mm);
}

/// The end of a line as far as it lies in the middle of its vessel. Noise pits walls, and thinning leads
/// lines from there into the corners between pits, where spheres are smaller.
struct MiddleEnd {
  std::size_t last;   ///< point
  double largest_mm;  ///< inscribed sphere within three radii of the end
};

MiddleEnd middle_end(const Line& line, const Lumen& lumen, double step_mm) {
  constexpr double kSmaller = 0.85, kReach = 3;  // of and in the largest radius
  std::vector<double> radii_mm;                  // from the end on
  double largest_mm = 0;
  for (std::size_t back = 0;
       back < line.size() && static_cast<double>(back) * step_mm <= kReach * largest_mm + step_mm; ++back) {
    const glm::dvec3& point = line[line.size() - 1 - back];
    const double radius_mm = lumen.inscribed_radius_mm(point);
    if (back > 0 && glm::distance(point, line.front()) < radius_mm) break;  // where it leaves a wider vessel
    radii_mm.push_back(radius_mm);
    largest_mm = std::max(largest_mm, radius_mm);
  }
  const auto fits = std::ranges::find_if(radii_mm, [&](double mm) { return mm >= kSmaller * largest_mm; });
  return {line.size() - 1 - static_cast<std::size_t>(fits - radii_mm.begin()), largest_mm};
}

/// The way from a point of a line on to the scan's side; none where the vessel is narrower before that.
std::optional<Line> way_to_border(const Line& line, const MiddleEnd& from, const Lumen& lumen,
                                  double step_mm) {
  constexpr std::size_t kTangentReach = 6;
  constexpr double kFarthest = 4, kWiden = 1.3;  // in radii: pitted, and flat where a vessel is about to fork
  constexpr double kAsWide = 0.75, kAside = 0.25, kTurn = 0.15;  // of the radius; by each step
  const std::size_t back = std::max(kTangentReach, static_cast<std::size_t>(from.largest_mm / step_mm)),
                    middle = from.last - std::min(from.last, back);
  glm::dvec3 along = tangent_at(line, middle, back), end = line[from.last];
  const auto section_at = [&](const glm::dvec3& p) {
    return cross_section(lumen, p, along, kWiden * from.largest_mm);
  };
  const double least_mm = kAsWide * std::min(section_at(line[middle]).radius_mm, section_at(end).radius_mm);
  Line way;
  for (int step = 1; step * step_mm < kFarthest * from.largest_mm; ++step) {
    const glm::dvec3 straight_on = end + step_mm * along;
    if (!lumen.contains(straight_on)) return way;
    const CrossSection section = section_at(straight_on);
    if (section.radius_mm < least_mm) return std::nullopt;
    const glm::dvec3 shift = section.to_middle_mm,
                     next = straight_on +
                            std::min(1.0, kAside * step_mm / std::max(glm::length(shift), 1e-9)) * shift;
    along = glm::normalize(glm::mix(along, glm::normalize(next - end), kTurn));
    way.push_back(next);
    end = next;
  }
  return std::nullopt;
}

/// Lets a line of a vessel that goes on beyond the scan reach the scan's side, from where it was last in the
/// middle, or else from its end.
void reach_border(Line& line, const Lumen& lumen, double step_mm) {
  const MiddleEnd middle = middle_end(line, lumen, step_mm),
                  end{line.size() - 1, lumen.inscribed_radius_mm(line.back())};
  for (const MiddleEnd& from : {middle, end})
    if (const std::optional<Line> way = way_to_border(line, from, lumen, step_mm)) {
      line.resize(from.last + 1);
      line.insert(line.end(), way->begin(), way->end());
      return;
    }
}

/// Which ends of a line may be moved; where it meets others it stays.
struct FreeEnds {
  bool first, last;
};

/// A line through the centroids of its cross-sections, its points `step_mm` apart.
Line centred(const Line& voxels_mm, FreeEnds free, const Lumen& lumen, double step_mm) {
  Line line = smoothed(resampled(voxels_mm, step_mm), 1.5 * lumen.coarsest_mm() / step_mm);
  for (int pass = 0; pass < 3; ++pass) {
    const Line moved = towards_middle(line, free.first ? 0 : 1, line.size() - (free.last ? 0 : 1), lumen);
    line = resampled(smoothed(moved, 1.5 * lumen.coarsest_mm() / step_mm), step_mm);
  }
  const auto fit_last = [&] {
    fit_end(line, lumen, step_mm);
    reach_border(line, lumen, step_mm);
  };
  if (free.last) fit_last();
  if (free.first) {
    std::ranges::reverse(line);
    fit_last();
    std::ranges::reverse(line);
  }
  return line;
}

std::vector<VesselPoint> with_radii(const Line& line, const Lumen& lumen, double step_mm) {
  constexpr std::size_t kTangentReach = 4;
  std::vector<double> radii_mm(line.size());
  const auto measure = [&](double reach_mm) {
    for (std::size_t i = 0; i < line.size(); ++i)
      radii_mm[i] =
          std::max(lumen.least_radius_mm(),
                   cross_section(lumen, line[i], tangent_at(line, i, kTangentReach), reach_mm).radius_mm);
  };
  measure(0);
  std::vector<double> sorted_mm = radii_mm;
  std::ranges::nth_element(sorted_mm, sorted_mm.begin() + std::ssize(sorted_mm) / 2);
  // A fold in a lumen that is as wide as elsewhere, as in a dissected aorta, is no narrow place.
  constexpr double kReach = 1.3;
  measure(kReach * sorted_mm[sorted_mm.size() / 2]);
  radii_mm = smoothed(radii_mm, 2 * lumen.coarsest_mm() / step_mm);
  std::vector<VesselPoint> points;
  for (std::size_t i = 0; i < line.size(); ++i) points.push_back({line[i], radii_mm[i]});
  return points;
}

/// Within its parent's lumen, 1.2 radii around the node that it starts from, a branch keeps at most the
/// radius that it shows outside of it.
void clamp_radius_near_parent(std::vector<VesselPoint>& points, double node_radius_mm) {
  std::size_t outside = 0;
  while (outside + 1 < points.size() &&
         glm::distance(points[outside].position_mm, points.front().position_mm) < 1.2 * node_radius_mm)
    ++outside;
  for (std::size_t i = 0; i < outside; ++i)
    points[i].radius_mm = std::min(points[i].radius_mm, points[outside].radius_mm);
}

double step_mm(const Lumen& lumen) { return 0.75 * lumen.voxel_mm(); }

/// The centrelines of a graph's edges.
std::vector<std::vector<VesselPoint>> centrelines_of(const SkeletonGraph& graph, const Lumen& lumen,
                                                     Progress& progress) {
  std::vector<std::vector<VesselPoint>> lines(graph.edges.size());
  progress.begin("centrelines", static_cast<std::int64_t>(graph.edges.size()), "branches");
  parallel_for(static_cast<std::int64_t>(graph.edges.size()), [&](std::int64_t e) {
    const SkeletonGraph::Edge& edge = graph.edges[static_cast<std::size_t>(e)];
    const auto is_free = [&](int n) { return graph.nodes[static_cast<std::size_t>(n)].edges.size() == 1; };
    const FreeEnds free{is_free(edge.nodes[0]), is_free(edge.nodes[1])};
    const double step = step_mm(lumen);
    lines[static_cast<std::size_t>(e)] = with_radii(centred(edge.points_mm, free, lumen, step), lumen, step);
    progress.advance();
  });
  return lines;
}

/// Traverses a pruned graph from the root so that every branch runs from its parent's side onwards.
class TreeBuilder {
 public:
  TreeBuilder(const SkeletonGraph& graph, std::vector<std::vector<VesselPoint>> lines)
      : graph_(graph), lines_(std::move(lines)) {}

  /// `bent_in`: the lumen in which lines bend towards side branches, as those of voxels do.
  Centrelines build(const std::optional<glm::dvec3>& root_mm, const LumenFill* fill, const Lumen* bent_in,
                    const std::string& name) {
    const auto nearness = [&](const FreeEnd& end) { return -glm::distance(end.position_mm, *root_mm); };
    const auto width = [](const FreeEnd& end) {
      return end.length_mm > 2 * end.radius_mm ? end.radius_mm : -1 / end.radius_mm;
    };
    traverse(root_mm ? best_end(nearness) : best_end(width));
    if (bent_in != nullptr) {
      branches_ = VesselTree(std::move(branches_), name).branches();  // with children
      straighten_junctions(branches_, bent_in);
    }
    if (fill != nullptr) radii_from_fill(*fill, branches_);
    VesselTree tree(std::move(branches_), name);
    return {std::move(tree), std::move(loops_), {}, 0};
  }

 private:
  struct FreeEnd {
    glm::dvec3 position_mm;
    double radius_mm;  ///< somewhat away from the end, which may be cut obliquely
    double length_mm;  ///< of its vessel, to where that branches
  };

  FreeEnd free_end(int node, int edge) const {
    const auto& line = lines_[static_cast<std::size_t>(edge)];
    const bool forwards = graph_.edges[static_cast<std::size_t>(edge)].nodes[0] == node;
    const std::size_t in = line.size() / 4;
    Line positions_mm;
    std::ranges::transform(line, std::back_inserter(positions_mm), &VesselPoint::position_mm);
    return {forwards ? positions_mm.front() : positions_mm.back(),
            line[forwards ? in : line.size() - 1 - in].radius_mm, length_mm(positions_mm)};
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

  void traverse(int root) {
    struct Step {
      int node, edge, parent;
    };
    std::vector<Step> stack;
    const auto push_edges = [&](int n, int from_edge, int parent) {
      for (const int e : graph_.nodes[static_cast<std::size_t>(n)].edges)
        if (e != from_edge) stack.push_back({n, e, parent});
    };
    push_edges(root, -1, -1);
    while (!stack.empty()) {
      const auto [n, e, parent] = stack.back();
      stack.pop_back();
      const SkeletonGraph::Edge& edge = graph_.edges[static_cast<std::size_t>(e)];
      std::vector<VesselPoint> points = std::move(lines_[static_cast<std::size_t>(e)]);
      if (edge.nodes[0] != n) std::ranges::reverse(points);
      if (parent >= 0) {
        points.front().position_mm = branches_[static_cast<std::size_t>(parent)].points.back().position_mm;
        clamp_radius_near_parent(points, branches_[static_cast<std::size_t>(parent)].points.back().radius_mm);
      }
      const auto self = static_cast<int>(branches_.size());
      if (edge.closes_loop) loops_.push_back(self);
      branches_.push_back({std::move(points), parent, {}, {}});
      push_edges(edge.nodes[edge.nodes[0] == n ? 1 : 0], e, self);
    }
  }

  const SkeletonGraph& graph_;
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

/// The graph of a skeleton with the links between its components: as lines of voxels within the scan, as
/// edges beyond it.
SkeletonGraph linked_graph(Mask skeleton, const std::vector<ComponentLink>& links) {
  for (const ComponentLink& link : links)
    if (!link.is_beyond_scan) rasterise(link, skeleton);
  SkeletonGraph graph = trace(skeleton);
  for (const ComponentLink& link : links)
    if (link.is_beyond_scan) add_edge(link, skeleton.geometry, graph);
  return graph;
}

void check_root(const VesselTree& tree, const glm::dvec3& root_mm) {
  check_near_end(tree.branches()[static_cast<std::size_t>(tree.root())].points.front().position_mm, root_mm,
                 fmt::format("`root_mm` {:g},{:g},{:g}", root_mm.x, root_mm.y, root_mm.z));
}

}  // namespace

Centrelines extract_centrelines(const Mask& mask, const std::string& name, Progress& progress,
                                const std::optional<glm::dvec3>& root_mm, const LumenFill* fill,
                                const Lumen* given) {
  const Box box = grown(bounding_box(mask), 2, mask.geometry.size);
  if (box.empty()) throw InputError("{}: no vessel: the mask is empty", name);
  const Mask part = crop(mask, box);
  // Tubes of a surface are often straight, those of a scan hardly ever.
  Mask skeleton = thin(part, progress, given != nullptr ? StraightLines::keep : StraightLines::shrink);
  std::optional<MaskLumen> of_mask;
  const Lumen& lumen = given != nullptr ? *given : of_mask.emplace(part);
  const ComponentLinks found = link_components(skeleton, [&](const Index3& end) {
    const glm::dvec3 end_mm = part.geometry.to_world_mm(glm::dvec3(end));
    return face_within(mask.geometry, end + box.lower,
                       lumen.inscribed_radius_mm(end_mm) + lumen.coarsest_mm());
  });
  // A mask of all voxels that lumen touches is made along ridges, and has fewer spurs than one of a
  // threshold.
  const double spur_vox = fill != nullptr && fill->is_of_touched_voxels ? 1 : 2;
  SkeletonGraph graph = prune(linked_graph(std::move(skeleton), found.links), lumen, spur_vox);
  if (graph.edges.empty())
    throw InputError("{}: no vessel: no structure in the mask is longer than it is wide", name);
  std::vector<std::vector<VesselPoint>> lines = centrelines_of(graph, lumen, progress);
  constexpr double kWide_vox = 3;  // of thinner vessels noise takes all or nothing
  while (given == nullptr) {
    const std::vector<int> leaves =
        inner_leaves(graph, lines, spur_vox * lumen.coarsest_mm(), kWide_vox * lumen.coarsest_mm());
    if (leaves.empty()) break;
    graph = without_leaves(std::move(graph), leaves, lumen);
    lines = centrelines_of(graph, lumen, progress);
  }
  Centrelines centrelines =
      TreeBuilder(graph, std::move(lines)).build(root_mm, fill, of_mask ? &lumen : nullptr, name);
  if (root_mm) check_root(centrelines.tree, *root_mm);
  for (const ComponentLink& link : found.links) centrelines.gaps_mm.push_back(link.length_mm);
  centrelines.parts_left_out = found.left_out;
  return centrelines;
}

}  // namespace xraycast
