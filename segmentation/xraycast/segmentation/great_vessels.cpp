#include "xraycast/segmentation/great_vessels.hpp"

#include "xraycast/base/parallel.hpp"
#include "xraycast/segmentation/bone.hpp"
#include "xraycast/volume/block_means.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

namespace xraycast {
namespace {

constexpr double kCell_mm = 3;
constexpr double kTissue_hu = 50, kLeast_hu = 95, kBone_hu = 300;
constexpr std::array kRadii_mm{4.5, 6.0, 8.0, 10.5, 13.0, 16.0};

/// A round cross-section that is brighter than what lies around it.
struct Disc {
  glm::dvec3 centre_mm;
  std::int64_t slice;
  double radius_mm, hu, contrast_hu;
  double spine_x_mm;  ///< of the middle of the bone behind it, from the centre on
};

/// Steps within a slice to the voxels from one distance to another.
std::vector<Index3> steps_between(const VolumeGeometry& g, double from_mm, double to_mm) {
  std::vector<Index3> steps;
  const auto reach = [&](int axis) { return static_cast<std::int64_t>(to_mm / g.spacing_mm[axis]); };
  for (std::int64_t y = -reach(1); y <= reach(1); ++y)
    for (std::int64_t x = -reach(0); x <= reach(0); ++x) {
      const double mm =
          std::hypot(static_cast<double>(x) * g.spacing_mm.x, static_cast<double>(y) * g.spacing_mm.y);
      if (mm >= from_mm && mm <= to_mm) steps.emplace_back(x, y, 0);
    }
  return steps;
}

/// The discs of a slice, and what is asked of them.
class DiscFinder {
 public:
  DiscFinder(const Volume& cells, const Mask& bone) : cells_(cells), bone_(bone), g_(cells.geometry()) {
    for (const double radius_mm : kRadii_mm)
      rings_.push_back({radius_mm, steps_between(g_, 0, radius_mm - 0.5 * kCell_mm),
                        steps_between(g_, radius_mm + kCell_mm, radius_mm + 2.2 * kCell_mm)});
  }

  /// The discs of a slice, none within another.
  std::vector<Disc> in_slice(std::int64_t z) const {
    std::vector<Disc> all, kept;
    for (std::int64_t y = 0; y < g_.size.y; ++y)
      for (std::int64_t x = 0; x < g_.size.x; ++x)
        if (const std::optional<Disc> disc = best_at({x, y, z})) all.push_back(*disc);
    std::ranges::stable_sort(all, [](const Disc& a, const Disc& b) { return a.contrast_hu > b.contrast_hu; });
    for (Disc& disc : all) {
      const auto overlaps = [&](const Disc& other) {
        return glm::distance(disc.centre_mm, other.centre_mm) < disc.radius_mm + other.radius_mm;
      };
      if (std::ranges::none_of(kept, overlaps) && lies_before_spine(disc)) kept.push_back(disc);
    }
    return kept;
  }

 private:
  struct Ring {
    double radius_mm;
    std::vector<Index3> inside, around;
  };

  bool is_inside_grid(const Index3& v) const {
    return v.x >= 0 && v.y >= 0 && v.x < g_.size.x && v.y < g_.size.y;
  }
  double hu(const Index3& v) const { return cells_.at(v.x, v.y, v.z); }

  std::optional<Disc> best_at(const Index3& v) const {
    if (bone_[v] != 0 || hu(v) < kLeast_hu || hu(v) > kBone_hu) return std::nullopt;
    std::optional<Disc> best;
    for (const Ring& ring : rings_)
      if (const std::optional<Disc> disc = disc_at(v, ring);
          disc && (!best || disc->contrast_hu > best->contrast_hu))
        best = disc;
    return best;
  }

  /// Within the ring all voxels are alike, and most of those around are darker.
  std::optional<Disc> disc_at(const Index3& v, const Ring& ring) const {
    constexpr double kAlike_hu = 30, kOfContrast = 0.3, kMostAround = 0.8, kMostBone = 0.5;
    double sum = 0, least = kBone_hu;
    for (const Index3& step : ring.inside) {
      const Index3 at = v + step;
      if (!is_inside_grid(at) || bone_[at] != 0) return std::nullopt;
      sum += hu(at);
      least = std::min(least, hu(at));
    }
    const double mean = sum / static_cast<double>(ring.inside.size());
    if (mean < kLeast_hu || least < mean - kAlike_hu) return std::nullopt;
    const double dark_hu = mean - kOfContrast * (mean - kTissue_hu);
    double dark = 0, bone = 0, others = 0, others_sum = 0;
    for (const Index3& step : ring.around) {
      const Index3 at = v + step;
      if (!is_inside_grid(at)) return std::nullopt;
      if (bone_[at] != 0) {
        ++bone;
        continue;
      }
      ++others;
      others_sum += std::max(hu(at), -200.0);  // the lung is no darker than fat
      dark += hu(at) < dark_hu;
    }
    const auto all = static_cast<double>(ring.around.size());
    if (bone > kMostBone * all || dark + bone < kMostAround * all || others == 0) return std::nullopt;
    return Disc{g_.to_world_mm(glm::dvec3(v)), v.z, ring.radius_mm, mean, mean - others_sum / others, 0};
  }

  /// Whether bone lies behind a disc and none before it; finds where it lies.
  bool lies_before_spine(Disc& disc) const {
    constexpr double kBeside_mm = 30, kBehind_mm = 45, kBefore_mm = 60, kLeast_mm2 = 300, kNear_mm = 20;
    const glm::dvec3 at = g_.to_index(disc.centre_mm);
    double behind = 0, before = 0, x_mm = 0, nearest_mm = kBehind_mm + disc.radius_mm;
    const auto first_x = static_cast<std::int64_t>(at.x - kBeside_mm / g_.spacing_mm.x),
               last_x = static_cast<std::int64_t>(at.x + kBeside_mm / g_.spacing_mm.x);
    for (std::int64_t y = 0; y < g_.size.y; ++y)
      for (std::int64_t x = std::max<std::int64_t>(0, first_x); x <= std::min(last_x, g_.size.x - 1); ++x) {
        if (bone_[Index3(x, y, disc.slice)] == 0) continue;
        const glm::dvec2 to = (glm::dvec2(x, y) - glm::dvec2(at)) * glm::dvec2(g_.spacing_mm);
        if (to.y > 0 && to.y < kBehind_mm + disc.radius_mm) {
          ++behind;
          x_mm += to.x;
          nearest_mm = std::min(nearest_mm, glm::length(to));
        } else if (to.y < 0 && to.y > -kBefore_mm - disc.radius_mm) {
          ++before;
        }
      }
    if (behind * g_.spacing_mm.x * g_.spacing_mm.y < kLeast_mm2) return false;
    disc.spine_x_mm = x_mm / behind;
    return before < 0.25 * behind && nearest_mm < kNear_mm + disc.radius_mm;
  }

  const Volume& cells_;
  const Mask& bone_;
  VolumeGeometry g_;
  std::vector<Ring> rings_;
};

/// Whether a disc goes on in another, some slices above it.
bool goes_on(const Disc& below, const Disc& above) {
  constexpr double kSlope = 0.7, kAlike_hu = 25, kAlikeRadius = 1.7;
  const glm::dvec3 to = above.centre_mm - below.centre_mm;
  return glm::length(glm::dvec2(to)) <= kCell_mm + kSlope * to.z &&
         std::abs(above.hu - below.hu) <= kAlike_hu &&
         std::max(above.radius_mm, below.radius_mm) <=
             kAlikeRadius * std::min(above.radius_mm, below.radius_mm);
}

/// The longest chain of discs that go on in each other, from below, at most kGap slices apart.
std::vector<Disc> longest_chain(const std::vector<Disc>& discs) {
  constexpr std::int64_t kGap = 3;
  std::vector<int> count(discs.size(), 1), before(discs.size(), -1);
  for (std::size_t i = 0; i < discs.size(); ++i)
    for (std::size_t j = i; j-- > 0 && discs[j].slice + kGap >= discs[i].slice;)
      if (discs[j].slice < discs[i].slice && count[j] + 1 > count[i] && goes_on(discs[j], discs[i]))
        count[i] = count[j] + 1, before[i] = static_cast<int>(j);
  std::vector<Disc> chain;
  if (discs.empty()) return chain;
  for (auto i = static_cast<int>(std::ranges::max_element(count) - count.begin()); i >= 0;
       i = before[static_cast<std::size_t>(i)])
    chain.push_back(discs[static_cast<std::size_t>(i)]);
  std::ranges::reverse(chain);
  return chain;
}

double median_hu(const std::vector<Disc>& chain) {
  std::vector<double> hu;
  for (const Disc& disc : chain) hu.push_back(disc.hu);
  const auto middle = hu.begin() + static_cast<std::ptrdiff_t>(hu.size() / 2);
  std::ranges::nth_element(hu, middle);
  return *middle;
}

struct Chain {
  GreatVessel vessel;
  double x_mm;
};

Chain vessel_of(const std::vector<Disc>& discs) {
  const double hu = median_hu(discs), length_mm = discs.back().centre_mm.z - discs.front().centre_mm.z;
  double x_mm = 0, spine_x_mm = 0;
  for (const Disc& disc : discs) {
    x_mm += disc.centre_mm.x / static_cast<double>(discs.size());
    spine_x_mm += disc.spine_x_mm / static_cast<double>(discs.size());
  }
  // Of the middle half, the disc that is as bright as most.
  const auto quarter = static_cast<std::ptrdiff_t>(discs.size() / 4);
  const auto seed = std::ranges::min_element(discs.begin() + quarter, discs.end() - quarter, {},
                                             [&](const Disc& disc) { return std::abs(disc.hu - hu); });
  return {{spine_x_mm <= 0 ? "aorta" : "vena cava", seed->centre_mm, hu, length_mm}, x_mm};
}

}  // namespace

std::vector<GreatVessel> find_great_vessels(const Volume& volume) {
  constexpr double kLeastLength_mm = 50;
  constexpr std::size_t kMost = 4;
  const Volume cells =
      block_means(volume, glm::max(Index3(glm::round(kCell_mm / volume.geometry().spacing_mm)), Index3(1)));
  Progress unheard;
  const Mask bone = find_bone(cells, {kBone_hu, kBone_hu, kBone_hu}, Mask(cells.geometry()), unheard);
  const DiscFinder finder(cells, bone);
  std::vector<std::vector<Disc>> of_slices(static_cast<std::size_t>(cells.geometry().size.z));
  parallel_for(cells.geometry().size.z,
               [&](std::int64_t z) { of_slices[static_cast<std::size_t>(z)] = finder.in_slice(z); });
  std::vector<Disc> discs;
  for (const std::vector<Disc>& slice : of_slices) discs.insert(discs.end(), slice.begin(), slice.end());

  std::vector<Chain> chains;
  while (chains.size() < kMost) {
    const std::vector<Disc> chain = longest_chain(discs);
    if (chain.size() < 2 || chain.back().centre_mm.z - chain.front().centre_mm.z < kLeastLength_mm) break;
    chains.push_back(vessel_of(chain));
    std::erase_if(discs, [&](const Disc& disc) {
      return std::ranges::any_of(chain, [&](const Disc& of_chain) {
        return glm::distance(disc.centre_mm, of_chain.centre_mm) < of_chain.radius_mm + kCell_mm;
      });
    });
  }
  if (chains.empty()) return {};
  const double longest_mm = chains.front().vessel.length_mm;
  const auto rank = [&](const Chain& chain) {
    return std::pair(2 * chain.vessel.length_mm >= longest_mm, chain.x_mm);
  };
  std::ranges::stable_sort(chains, [&](const Chain& a, const Chain& b) { return rank(a) > rank(b); });
  std::vector<GreatVessel> vessels;
  for (const Chain& chain : chains) vessels.push_back(chain.vessel);
  return vessels;
}

}  // namespace xraycast
