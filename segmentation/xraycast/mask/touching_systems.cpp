#include "xraycast/mask/touching_systems.hpp"

#include "xraycast/base/union_find.hpp"
#include "xraycast/mask/components.hpp"
#include "xraycast/mask/distance_transform.hpp"

#include <algorithm>
#include <array>
#include <map>
#include <queue>
#include <utility>

namespace xraycast {
namespace {

/// The stretches of the vessels of a mask, each about a maximum of the distance from the wall, and the necks
/// between those that touch.
class Stretches {
 public:
  explicit Stretches(const Mask& mask)
      : mask_(mask), depth_mm_(distance_to_background_mm(mask)), stretch_of_(mask.voxels.size(), kNone) {
    for (const std::size_t at : deepest_first(mask, depth_mm_)) flood(at);
  }

  /// Of a voxel of the mask.
  std::size_t at(const Index3& voxel) const { return of(mask_.offset(voxel)); }
  std::size_t of(std::size_t voxel) const { return static_cast<std::size_t>(stretch_of_[voxel]); }

  struct Neck {
    std::size_t a, b;
    float radius_mm;
  };
  std::vector<Neck> necks() const {
    std::vector<Neck> necks;
    necks.reserve(neck_mm_.size());
    for (const auto& [pair, mm] : neck_mm_)
      necks.push_back({static_cast<std::size_t>(pair.first), static_cast<std::size_t>(pair.second), mm});
    return necks;
  }

  /// The largest distance from the wall in each stretch.
  const std::vector<float>& radii_mm() const { return radii_mm_; }

 private:
  static constexpr std::int32_t kNone = -1;

  /// A voxel joins the stretch of its deepest neighbour; the first at which two stretches meet is the deepest
  /// of their neck.
  void flood(std::size_t at) {
    const Index3 here = voxel_at(mask_.geometry, static_cast<std::int64_t>(at));
    std::array<std::int32_t, 26> around{};
    std::size_t count = 0, uphill = at;
    for (const Index3& step : kNeighbours) {
      if (!mask_.at(here + step)) continue;
      const std::size_t near = mask_.offset(here + step);
      if (stretch_of_[near] == kNone) continue;
      around[count++] = stretch_of_[near];
      if (uphill == at || depth_mm_[near] > depth_mm_[uphill]) uphill = near;
    }
    if (uphill == at) {
      stretch_of_[at] = static_cast<std::int32_t>(radii_mm_.size());
      radii_mm_.push_back(depth_mm_[at]);
      return;
    }
    const std::int32_t own = stretch_of_[at] = stretch_of_[uphill];
    for (std::size_t i = 0; i < count; ++i)
      if (around[i] != own) neck_mm_.try_emplace(std::minmax(own, around[i]), depth_mm_[at]);
  }

  const Mask& mask_;
  std::vector<float> depth_mm_;
  std::vector<std::int32_t> stretch_of_;
  std::vector<float> radii_mm_;
  std::map<std::pair<std::int32_t, std::int32_t>, float> neck_mm_;
};

enum class System : std::uint8_t { unknown, own, other };

/// Joins stretches to systems.
class Joining {
 public:
  /// `systems`: what is known of each stretch.
  Joining(const Stretches& stretches, std::vector<System> systems)
      : sets_(systems.size()), radii_mm_(stretches.radii_mm()), systems_(std::move(systems)) {
    for (const Stretches::Neck& neck : stretches.necks()) queue_.push({width(neck), neck});
    while (!queue_.empty()) {
      Candidate next = queue_.top();
      queue_.pop();
      const float now = width(next.neck);
      if (now < next.width)
        queue_.push({now, next.neck});  // what lies beside it has grown
      else
        join(sets_.find(next.neck.a), sets_.find(next.neck.b));
    }
  }

  System system(std::size_t stretch) { return systems_[sets_.find(stretch)]; }

 private:
  struct Candidate {
    float width;
    Stretches::Neck neck;
    bool operator<(const Candidate& other) const { return width < other.width; }
  };

  /// Relative to the narrower one of what has been joined on both sides.
  float width(const Stretches::Neck& neck) {
    return neck.radius_mm / std::min(radii_mm_[sets_.find(neck.a)], radii_mm_[sets_.find(neck.b)]);
  }

  void join(std::size_t a, std::size_t b) {
    if (a == b) return;
    if (systems_[a] == System::unknown) std::swap(a, b);
    if (systems_[b] != System::unknown && systems_[b] != systems_[a]) return;
    sets_.unite(a, b);
    radii_mm_[a] = std::max(radii_mm_[a], radii_mm_[b]);
  }

  UnionFind sets_;
  std::vector<float> radii_mm_;  ///< the largest of each set
  std::vector<System> systems_;
  std::priority_queue<Candidate> queue_;
};

/// The components of a mask that hold points of both kinds.
Mask shared_components(const Mask& mask, const std::vector<Index3>& own, const std::vector<Index3>& others) {
  const Components components(mask);
  std::vector<bool> holds_own(static_cast<std::size_t>(components.count())), keep = holds_own;
  for (const Index3& point : own) holds_own[static_cast<std::size_t>(components.at(point))] = true;
  for (const Index3& point : others) {
    const auto component = static_cast<std::size_t>(components.at(point));
    keep[component] = holds_own[component];
  }
  return components.select(keep);
}

}  // namespace

Mask touching_system(const Mask& mask, const std::vector<Index3>& own, const std::vector<Index3>& others,
                     double max_radius_mm) {
  Mask result(mask.geometry);
  const Mask shared = shared_components(mask, own, others);
  const Box box = grown(bounding_box(shared), 1, mask.geometry.size);
  if (box.empty()) return result;
  Mask part = crop(shared, box);
  const Stretches stretches(part);
  std::vector<System> systems(stretches.radii_mm().size());
  for (const Index3& point : others) {
    if (!part.at(point - box.lower)) continue;
    const std::size_t stretch = stretches.at(point - box.lower);
    if (stretches.radii_mm()[stretch] <= max_radius_mm) systems[stretch] = System::other;
  }
  for (const Index3& point : own)
    if (part.at(point - box.lower)) systems[stretches.at(point - box.lower)] = System::own;
  Joining joined(stretches, std::move(systems));
  for (std::size_t i = 0; i < part.voxels.size(); ++i)
    if (part.voxels[i] != 0) part.voxels[i] = joined.system(stretches.of(i)) == System::other;
  paste(part, box, result);
  return result;
}

}  // namespace xraycast
