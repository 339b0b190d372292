#include "xraycast/segmentation/gap_closing.hpp"

#include "xraycast/base/union_find.hpp"
#include "xraycast/mask/components.hpp"
#include "xraycast/mask/distance_transform.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <queue>

namespace xraycast {
namespace {

constexpr double kMaxLength_mm = 40, kMaxOfShorter = 2, kMaxRadius_mm = 2.5;

/// The diagonal of each component's bounding box.
std::vector<double> extents_mm(const Components& components, const VolumeGeometry& g) {
  std::vector<Box> boxes(static_cast<std::size_t>(components.count()), {g.size, {0, 0, 0}});
  for (const Components::Run& run : components.runs()) {
    const Index3 first = voxel_at(g, run.first);
    Box& box = boxes[static_cast<std::size_t>(run.component)];
    box.lower = glm::min(box.lower, first);
    box.upper = glm::max(box.upper, first + Index3(run.length, 1, 1));
  }
  std::vector<double> result;
  for (const Box& box : boxes)
    result.push_back(glm::length(g.spacing_mm * glm::dvec3(box.upper - box.lower)));
  return result;
}

/// The geodesic paths between components, by fronts that grow from all of them at once (Dijkstra, A note on
/// two problems in connexion with graphs, 1959).
class Fronts {
 public:
  Fronts(const Mask& candidates, const Components& components, const std::vector<float>& depth_mm)
      : candidates_(candidates), depth_mm_(depth_mm), slots_(candidates.voxels.size(), kUnvisited) {
    for (const Components::Run& run : components.runs())
      for (std::int64_t i = run.first; i < run.first + run.length; ++i) {
        const Index3 voxel = voxel_at(candidates.geometry, i);
        const bool is_on_border =
            std::ranges::any_of(kNeighbours, [&](const Index3& step) { return candidates.at(voxel + step); });
        if (is_on_border) visit(i, {0, 0, run.component, -1});
      }
  }

  struct Path {
    double cost_mm = std::numeric_limits<double>::infinity(), length_mm = 0;
    std::int64_t from = -1, to = -1;  ///< the voxels where two fronts met
  };

  /// The cheapest path between each two components whose fronts meet.
  std::map<std::pair<int, int>, Path> meet() {
    std::map<std::pair<int, int>, Path> paths;
    while (!queue_.empty()) {
      check_cancelled();
      const auto [mm, at] = queue_.top();
      queue_.pop();
      const Visited here = *visited(at);
      if (mm > here.cost_mm) continue;
      const Index3 voxel = voxel_at(candidates_.geometry, at);
      for (const Index3& step : kNeighbours) {
        const Index3 near = voxel + step;
        if (!candidates_.contains(near)) continue;
        const auto offset = static_cast<std::int64_t>(candidates_.offset(near));
        const double step_mm = glm::length(candidates_.geometry.spacing_mm * glm::dvec3(step)),
                     cost_mm = mm + step_mm * cost(near, step_mm), length_mm = here.length_mm + step_mm;
        const Visited* known = visited(offset);
        if (known != nullptr && known->component != here.component) {
          const auto [low, high] = std::minmax(here.component, known->component);
          if (Path& path = paths[{low, high}]; cost_mm + known->cost_mm < path.cost_mm)
            path = {cost_mm + known->cost_mm, length_mm + known->length_mm, at, offset};
        } else if (candidates_.at(near) && length_mm <= 0.5 * kMaxLength_mm &&
                   (known == nullptr || cost_mm < known->cost_mm)) {
          visit(offset, {cost_mm, length_mm, here.component, at});
        }
      }
    }
    return paths;
  }

  /// The voxels of a path, but for those of the components themselves.
  std::vector<std::int64_t> voxels(const Path& path) const {
    std::vector<std::int64_t> result;
    for (std::int64_t at : {path.from, path.to})
      for (; at >= 0; at = visited(at)->from) result.push_back(at);
    return result;
  }

 private:
  struct Visited {
    double cost_mm, length_mm;
    int component;
    std::int64_t from;
  };

  const Visited* visited(std::int64_t offset) const {
    const std::int32_t slot = slots_[static_cast<std::size_t>(offset)];
    return slot == kUnvisited ? nullptr : &visited_[static_cast<std::size_t>(slot)];
  }

  void visit(std::int64_t offset, const Visited& voxel) {
    std::int32_t& slot = slots_[static_cast<std::size_t>(offset)];
    if (slot == kUnvisited) {
      slot = static_cast<std::int32_t>(visited_.size());
      visited_.push_back(voxel);
    } else {
      visited_[static_cast<std::size_t>(slot)] = voxel;
    }
    queue_.push({voxel.cost_mm, offset});
  }

  /// Of a path per length: 2 along a wall, the closer to 1 the deeper it lies.
  double cost(const Index3& voxel, double step_mm) const {
    const double depth_mm = depth_mm_[candidates_.offset(voxel)];
    return 1 + std::min(1.0, step_mm / std::max(depth_mm, 1e-6));
  }

  const Mask& candidates_;
  const std::vector<float>& depth_mm_;
  static constexpr std::int32_t kUnvisited = -1;
  std::vector<std::int32_t> slots_;  ///< the index of a voxel in `visited_`
  std::vector<Visited> visited_;
  using Queued = std::pair<double, std::int64_t>;
  std::priority_queue<Queued, std::vector<Queued>, std::greater<>> queue_;
};

void paint_ball(Mask& mask, const Mask& within, const Index3& centre, double radius_mm) {
  const glm::dvec3 s = mask.geometry.spacing_mm;
  const Index3 reach(radius_mm / s);
  for (std::int64_t z = -reach.z; z <= reach.z; ++z)
    for (std::int64_t y = -reach.y; y <= reach.y; ++y)
      for (std::int64_t x = -reach.x; x <= reach.x; ++x)
        if (const Index3 d(x, y, z); glm::length(s * glm::dvec3(d)) <= radius_mm && within.at(centre + d))
          mask[centre + d] = 1;
}

}  // namespace

void close_gaps(Mask& whole, const Mask& whole_candidates, Progress& progress) {
  progress.begin("closing gaps", 3, "passes");
  const Box box = grown(bounding_box(whole_candidates), 1, whole.geometry.size);
  if (box.empty()) return;
  Mask mask = crop(whole, box);
  const Mask candidates = crop(whole_candidates, box);
  const Components components(mask);
  if (components.count() < 2) return;
  const std::vector<double> extent_mm = extents_mm(components, mask.geometry);
  const std::vector<float> depth_mm = distance_to_background_mm(candidates);
  progress.advance();
  Fronts fronts(candidates, components, depth_mm);
  const auto paths = fronts.meet();
  progress.advance();
  std::vector<std::pair<std::pair<int, int>, Fronts::Path>> order(paths.begin(), paths.end());
  std::ranges::stable_sort(order,
                           [](const auto& a, const auto& b) { return a.second.cost_mm < b.second.cost_mm; });

  UnionFind joined(static_cast<std::size_t>(components.count()));
  for (const auto& [pair, path] : order) {
    const auto from = static_cast<std::size_t>(pair.first), to = static_cast<std::size_t>(pair.second);
    const double max_mm = std::min(kMaxLength_mm, kMaxOfShorter * std::min(extent_mm[from], extent_mm[to]));
    if (path.length_mm > max_mm || !joined.unite(to, from)) continue;
    for (const std::int64_t at : fronts.voxels(path)) {
      const Index3 voxel = voxel_at(mask.geometry, at);
      mask[voxel] = 1;
      paint_ball(mask, candidates, voxel,
                 std::min(kMaxRadius_mm, static_cast<double>(depth_mm[static_cast<std::size_t>(at)])));
    }
  }
  paste(mask, box, whole);
  progress.advance();
}

}  // namespace xraycast
