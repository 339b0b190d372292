#include "xraycast/segmentation/bridges.hpp"

#include "xraycast/mask/components.hpp"
#include "xraycast/mask/distance_transform.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <queue>

namespace xraycast {
namespace {

constexpr double kLongest_mm = 40, kOfShorter = 2, kThickest_mm = 2.5;

/// The diagonal of each part's box.
std::vector<double> lengths_mm(const Components& parts, const VolumeGeometry& g) {
  std::vector<Box> boxes(static_cast<std::size_t>(parts.count()), {g.size, {0, 0, 0}});
  for (const Components::Run& run : parts.runs()) {
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

/// The shortest ways between parts, found by fronts that grow from all of them at once (Dijkstra).
class Fronts {
 public:
  Fronts(const Mask& candidates, const Components& parts, const std::vector<float>& depth_mm)
      : candidates_(candidates), depth_mm_(depth_mm), slots_(candidates.voxels.size(), kUnseen) {
    for (const Components::Run& run : parts.runs())
      for (std::int64_t i = run.first; i < run.first + run.length; ++i) {
        const Index3 voxel = voxel_at(candidates.geometry, i);
        const bool is_outer =
            std::ranges::any_of(kNeighbours, [&](const Index3& step) { return candidates.at(voxel + step); });
        if (is_outer) reach(i, {0, 0, run.component, -1});
      }
  }

  struct Way {
    double cost_mm = std::numeric_limits<double>::infinity(), length_mm = 0;
    std::int64_t from = -1, to = -1;  ///< the voxels where two fronts met
  };

  /// The shortest way between each two parts that meet.
  std::map<std::pair<int, int>, Way> meet() {
    std::map<std::pair<int, int>, Way> ways;
    while (!waiting_.empty()) {
      const auto [mm, at] = waiting_.top();
      waiting_.pop();
      const Reached here = *reached(at);
      if (mm > here.cost_mm) continue;
      const Index3 voxel = voxel_at(candidates_.geometry, at);
      for (const Index3& step : kNeighbours) {
        const Index3 near = voxel + step;
        if (!candidates_.contains(near)) continue;
        const auto offset = static_cast<std::int64_t>(candidates_.offset(near));
        const double step_mm = glm::length(candidates_.geometry.spacing_mm * glm::dvec3(step)),
                     cost_mm = mm + step_mm * cost(near, step_mm), length_mm = here.length_mm + step_mm;
        const Reached* known = reached(offset);
        if (known != nullptr && known->part != here.part) {
          const auto [low, high] = std::minmax(here.part, known->part);
          if (Way& way = ways[{low, high}]; cost_mm + known->cost_mm < way.cost_mm)
            way = {cost_mm + known->cost_mm, length_mm + known->length_mm, at, offset};
        } else if (candidates_.at(near) && length_mm <= 0.5 * kLongest_mm &&
                   (known == nullptr || cost_mm < known->cost_mm)) {
          reach(offset, {cost_mm, length_mm, here.part, at});
        }
      }
    }
    return ways;
  }

  /// The voxels of a way, but for those of the parts themselves.
  std::vector<std::int64_t> voxels(const Way& way) const {
    std::vector<std::int64_t> result;
    for (std::int64_t at : {way.from, way.to})
      for (; at >= 0; at = reached(at)->from) result.push_back(at);
    return result;
  }

 private:
  struct Reached {
    double cost_mm, length_mm;
    int part;
    std::int64_t from;
  };

  const Reached* reached(std::int64_t offset) const {
    const std::int32_t slot = slots_[static_cast<std::size_t>(offset)];
    return slot == kUnseen ? nullptr : &reached_[static_cast<std::size_t>(slot)];
  }

  void reach(std::int64_t offset, const Reached& reached) {
    std::int32_t& slot = slots_[static_cast<std::size_t>(offset)];
    if (slot == kUnseen) {
      slot = static_cast<std::int32_t>(reached_.size());
      reached_.push_back(reached);
    } else {
      reached_[static_cast<std::size_t>(slot)] = reached;
    }
    waiting_.push({reached.cost_mm, offset});
  }

  /// Of a way per length: 2 along a wall, the closer to 1 the deeper it lies.
  double cost(const Index3& voxel, double step_mm) const {
    const double depth_mm = depth_mm_[candidates_.offset(voxel)];
    return 1 + std::min(1.0, step_mm / std::max(depth_mm, 1e-6));
  }

  const Mask& candidates_;
  const std::vector<float>& depth_mm_;
  static constexpr std::int32_t kUnseen = -1;
  std::vector<std::int32_t> slots_;  ///< where in `reached_` a voxel is
  std::vector<Reached> reached_;
  using Waiting = std::pair<double, std::int64_t>;
  std::priority_queue<Waiting, std::vector<Waiting>, std::greater<>> waiting_;
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

void bridge_gaps(Mask& whole, const Mask& whole_candidates, Progress& progress) {
  progress.begin("bridging gaps", 3, "passes");
  const Box box = grown(bounding_box(whole_candidates), 1, whole.geometry.size);
  if (box.empty()) return;
  Mask mask = crop(whole, box);
  const Mask candidates = crop(whole_candidates, box);
  const Components parts(mask);
  if (parts.count() < 2) return;
  const std::vector<double> length_mm = lengths_mm(parts, mask.geometry);
  const std::vector<float> depth_mm = distance_to_outside_mm(candidates);
  progress.advance();
  Fronts fronts(candidates, parts, depth_mm);
  const auto ways = fronts.meet();
  progress.advance();
  std::vector<std::pair<std::pair<int, int>, Fronts::Way>> order(ways.begin(), ways.end());
  std::ranges::stable_sort(order,
                           [](const auto& a, const auto& b) { return a.second.cost_mm < b.second.cost_mm; });

  std::vector<int> joined(static_cast<std::size_t>(parts.count()));
  std::iota(joined.begin(), joined.end(), 0);
  const auto find = [&](int part) {
    while (joined[static_cast<std::size_t>(part)] != part) part = joined[static_cast<std::size_t>(part)];
    return part;
  };
  for (const auto& [pair, way] : order) {
    const int from = find(pair.first), to = find(pair.second);
    const double shorter_mm = std::min(length_mm[static_cast<std::size_t>(pair.first)],
                                       length_mm[static_cast<std::size_t>(pair.second)]),
                 most_mm = std::min(kLongest_mm, kOfShorter * shorter_mm);
    if (from == to || way.length_mm > most_mm) continue;
    joined[static_cast<std::size_t>(from)] = to;
    for (const std::int64_t at : fronts.voxels(way)) {
      const Index3 voxel = voxel_at(mask.geometry, at);
      mask[voxel] = 1;
      paint_ball(mask, candidates, voxel,
                 std::min(kThickest_mm, static_cast<double>(depth_mm[static_cast<std::size_t>(at)])));
    }
  }
  paste(mask, box, whole);
  progress.advance();
}

}  // namespace xraycast
