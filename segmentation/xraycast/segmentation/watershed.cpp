#include "xraycast/segmentation/watershed.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/parallel.hpp"
#include "xraycast/base/union_find.hpp"
#include "xraycast/mask/components.hpp"
#include "xraycast/mask/distance_transform.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <unordered_map>
#include <utility>

namespace xraycast {
namespace {

constexpr double kGrid_mm = 1.5;

/// How many voxels become one, along each axis.
Index3 downsampling_factor(const glm::dvec3& spacing_mm) {
  return glm::max(Index3(1), Index3(glm::round(kGrid_mm / spacing_mm)));
}

/// Downsampled by majority: a coarse voxel is inside where half of its voxels are.
Mask downsampled(const Mask& mask, const Index3& step) {
  VolumeGeometry g = mask.geometry;
  g.size = (g.size + step - Index3(1)) / step;
  g.origin_mm = mask.geometry.to_world_mm(0.5 * glm::dvec3(step - Index3(1)));
  g.spacing_mm *= glm::dvec3(step);
  Mask result(g);
  const std::int64_t half = (step.x * step.y * step.z + 1) / 2;
  parallel_for(g.size.z, [&](std::int64_t z) {
    for (std::int64_t y = 0; y < g.size.y; ++y)
      for (std::int64_t x = 0; x < g.size.x; ++x) {
        std::int64_t inside = 0;
        for (std::int64_t k = 0; k < step.z; ++k)
          for (std::int64_t j = 0; j < step.y; ++j)
            for (std::int64_t i = 0; i < step.x; ++i)
              inside += mask.at(Index3(x, y, z) * step + Index3(i, j, k));
        result[{x, y, z}] = inside >= half;
      }
  });
  return result;
}

/// Dilation by a ball.
Mask dilated_by_ball(const Mask& mask, double radius_mm) {
  const std::vector<float> away_mm = distance_to_foreground_mm(mask);
  Mask result(mask.geometry);
  for (std::size_t i = 0; i < away_mm.size(); ++i) result.voxels[i] = away_mm[i] <= radius_mm;
  return result;
}

/// How much nearer the wall is than the centre of the next voxel outside.
double half_voxel_mm(const VolumeGeometry& grid) {
  const glm::dvec3 s = grid.spacing_mm;
  return 0.5 * std::max({s.x, s.y, s.z});
}

/// The opening by balls larger than `max_radius_mm`, after a dilation that closes the trabeculae and
/// papillary muscles of a heart chamber.
Mask opening(const Mask& mask, double max_radius_mm) {
  constexpr double kMuscle_mm = 4;
  const std::vector<float> closed_mm = distance_to_background_mm(dilated_by_ball(mask, kMuscle_mm));
  Mask centres(mask.geometry);
  for (std::size_t i = 0; i < closed_mm.size(); ++i)
    centres.voxels[i] = closed_mm[i] > max_radius_mm + kMuscle_mm;
  return centres.count() > 0 ? dilated_by_ball(centres, max_radius_mm) : centres;
}

/// The meaning of a basin's marker.
enum class Label : std::uint8_t { unlabelled, vessel, chamber };

/// Floods a mask from the maxima of its distance transform on, in descending order. Where two basins meet,
/// the neck between them decides: basins of one vessel have a neck about as wide as the narrower one of them,
/// structures that only touch a narrow one.
class MarkerWatershed {
 public:
  /// Basins that `whole` has separated stay apart.
  MarkerWatershed(const Mask& mask, const std::vector<float>& distance_mm, MarkerWatershed* whole = nullptr)
      : mask_(mask), distance_mm_(distance_mm), whole_(whole), basin_of_(mask.voxels.size(), -1) {
    half_voxel_mm_ = static_cast<float>(half_voxel_mm(mask.geometry));
  }

  void mark(std::size_t voxel, Label label) { markers_[voxel] = label; }

  /// `order`: the mask's voxels, the deepest first.
  void run(const std::vector<std::size_t>& order) {
    for (const std::size_t at : order) flood(at);
  }

  /// The basin of a voxel of the mask, the same number for all basins that were merged.
  int basin(std::size_t at) { return find(basin_of_[at]); }
  bool is_chamber(int basin) const {
    return basins_[static_cast<std::size_t>(basin)].label == Label::chamber;
  }

  /// The regional maximum of the distance transform from which a voxel was flooded, before any merge.
  std::size_t maximum(std::size_t at) const {
    return basins_[static_cast<std::size_t>(basin_of_[at])].maximum;
  }

 private:
  struct Basin {
    std::size_t maximum;
    float maximum_mm;
    Label label;
  };

  int find(int basin) { return static_cast<int>(merged_.find(static_cast<std::size_t>(basin))); }

  void flood(std::size_t at) {
    const Index3 here = voxel_at(mask_.geometry, static_cast<std::int64_t>(at));
    std::array<int, 26> around{};
    std::size_t count = 0, uphill = at;
    for (const Index3& step : kNeighbours)
      if (mask_.at(here + step))
        if (const std::size_t near = mask_.offset(here + step); basin_of_[near] >= 0) {
          const int basin = find(basin_of_[near]);
          const auto known = std::find(around.begin(), around.begin() + count, basin);
          if (known == around.begin() + count) around[count++] = basin;
          if (uphill == at || distance_mm_[near] > distance_mm_[uphill]) {
            std::iter_swap(around.begin(), std::find(around.begin(), around.begin() + count, basin));
            uphill = near;
          }
        }
    // The basin uphill takes the voxel; the others merge with it where the neck is wide.
    const auto marker = markers_.find(at);
    const Label label = marker == markers_.end() ? Label::unlabelled : marker->second;
    if (count == 0 ||
        (label != Label::unlabelled && !agree(label, basins_[static_cast<std::size_t>(around[0])].label))) {
      basin_of_[at] = static_cast<int>(merged_.add());
      basins_.push_back({at, distance_mm_[at], label});
      return;
    }
    basin_of_[at] = basin_of_[uphill];
    if (label != Label::unlabelled) basins_[static_cast<std::size_t>(around[0])].label = label;
    for (std::size_t i = 1; i < count; ++i) merge(find(around[0]), find(around[i]), distance_mm_[at]);
  }

  static bool agree(Label a, Label b) { return a == Label::unlabelled || b == Label::unlabelled || a == b; }

  void merge(int higher, int lower, float neck_mm) {
    if (higher == lower) return;
    if (basins_[static_cast<std::size_t>(higher)].maximum_mm <
        basins_[static_cast<std::size_t>(lower)].maximum_mm)
      std::swap(higher, lower);
    constexpr float kOneVessel = 0.5F;  // a stenosis halves the diameter
    constexpr float kNoVessel = 0.97F;  // a bulge in a chamber's wall
    Basin &a = basins_[static_cast<std::size_t>(higher)], &b = basins_[static_cast<std::size_t>(lower)];
    if (whole_ != nullptr && whole_->basin(a.maximum) != whole_->basin(b.maximum)) return;
    if (a.label != b.label && a.label != Label::unlabelled && b.label != Label::unlabelled) return;
    const bool chamber = a.label == Label::chamber || b.label == Label::chamber;
    const Basin& open = a.label == Label::chamber ? b : a;
    if (chamber && a.label != b.label ? neck_mm < kNoVessel * open.maximum_mm
                                      : neck_mm + half_voxel_mm_ < kOneVessel * b.maximum_mm)
      return;
    merged_.unite(static_cast<std::size_t>(higher), static_cast<std::size_t>(lower));
    if (a.label == Label::unlabelled) a.label = b.label;
  }

  const Mask& mask_;
  const std::vector<float>& distance_mm_;
  MarkerWatershed* whole_;
  float half_voxel_mm_;  ///< to which distances are known
  std::vector<int> basin_of_;
  std::vector<Basin> basins_;
  UnionFind merged_;  ///< the deepest basin represents those merged with it
  std::unordered_map<std::size_t, Label> markers_;
};

/// The maxima of the basins that are chambers: most of their voxels survive the opening by `max_radius_mm`,
/// or they are that deep themselves.
std::vector<std::size_t> chamber_maxima(const Mask& mask, const std::vector<float>& distance_mm,
                                        const MarkerWatershed& watershed, double max_radius_mm) {
  const Mask wide = opening(mask, max_radius_mm);
  std::unordered_map<std::size_t, std::int64_t> majority;
  for (std::size_t i = 0; i < mask.voxels.size(); ++i)
    if (mask.voxels[i] != 0) majority[watershed.maximum(i)] += wide.voxels[i] != 0 ? 1 : -1;
  const double deepest_mm = max_radius_mm + half_voxel_mm(mask.geometry);
  std::vector<std::size_t> maxima;
  for (const auto& [maximum, votes] : majority)
    if (votes > 0 || distance_mm[maximum] > deepest_mm) maxima.push_back(maximum);
  return maxima;
}

}  // namespace

Index3 nearest_voxel(const Mask& mask, const glm::dvec3& point_mm, const std::string& name) {
  constexpr double kReach_mm = 5;
  const VolumeGeometry& g = mask.geometry;
  const Index3 reach(glm::ceil(kReach_mm / g.spacing_mm)), middle(glm::round(g.to_index(point_mm)));
  double nearest_mm = kReach_mm;
  Index3 best(-1);
  for (std::int64_t z = -reach.z; z <= reach.z; ++z)
    for (std::int64_t y = -reach.y; y <= reach.y; ++y)
      for (std::int64_t x = -reach.x; x <= reach.x; ++x) {
        const Index3 voxel = middle + Index3(x, y, z);
        if (!mask.at(voxel)) continue;
        const double mm = glm::distance(g.to_world_mm(glm::dvec3(voxel)), point_mm);
        if (mm <= nearest_mm) nearest_mm = mm, best = voxel;
      }
  if (best.x < 0)
    throw InputError(
        "{}: the point ({:.1f}, {:.1f}, {:.1f}) mm does not lie in a bright structure; check its coordinates "
        "in the scan",
        name, point_mm.x, point_mm.y, point_mm.z);
  return best;
}

void separate_chambers(Mask& mask, const Markers& markers, const std::string& name, Progress& progress) {
  progress.begin("separating chambers", 4, "passes");
  for (const auto* points : {&markers.vessels_mm, &markers.not_vessels_mm})
    for (const glm::dvec3& point : *points) nearest_voxel(mask, point, name);  // throws where there is none

  const Box box = grown(bounding_box(mask), 2, mask.geometry.size);
  if (box.empty()) return;
  const Index3 step = downsampling_factor(mask.geometry.spacing_mm);
  Mask part = crop(mask, box);
  const Mask grid = downsampled(part, step);
  const std::vector<float> distance_mm = distance_to_background_mm(grid);

  progress.advance();

  // What only touches is separated before chambers are known: it must not depend on what they are.
  const std::vector<std::size_t> order = deepest_first(grid, distance_mm);
  MarkerWatershed whole(grid, distance_mm);
  whole.run(order);
  MarkerWatershed flooding(grid, distance_mm, &whole);
  for (const std::size_t maximum : chamber_maxima(grid, distance_mm, whole, markers.max_radius_mm))
    flooding.mark(maximum, Label::chamber);
  for (const auto& [points, label] :
       {std::pair(&markers.vessels_mm, Label::vessel), std::pair(&markers.not_vessels_mm, Label::chamber)})
    for (const glm::dvec3& point : *points) {
      const Index3 voxel = (nearest_voxel(mask, point, name) - box.lower) / step;
      if (grid.at(voxel)) flooding.mark(grid.offset(voxel), label);
    }
  progress.advance();
  flooding.run(order);
  progress.advance();

  // Chambers are removed, and of two basins that touch the one with the higher number loses the voxels
  // between.
  std::vector<std::int32_t> basins(grid.voxels.size(), -1);
  for (std::size_t i = 0; i < basins.size(); ++i)
    if (grid.voxels[i] != 0) basins[i] = flooding.basin(i);
  const Index3 size = part.geometry.size;
  const auto basin_at = [&](const Index3& voxel) { return basins[grid.offset(voxel / step)]; };
  Mask kept = part;
  parallel_for(size.z, [&](std::int64_t z) {
    for (std::int64_t y = 0; y < size.y; ++y)
      for (std::int64_t x = 0; x < size.x; ++x) {
        const Index3 here(x, y, z);
        const int mine = part[here] != 0 ? basin_at(here) : -1;
        if (mine < 0) continue;
        bool lost = flooding.is_chamber(mine);
        for (std::size_t n = 0; n < 26 && !lost; ++n) {
          const Index3 near = here + kNeighbours[n];
          const int other = part.at(near) ? basin_at(near) : -1;
          lost = other >= 0 && other < mine;
        }
        if (lost) kept[here] = 0;
      }
  });
  paste(kept, box, mask);
  progress.advance();
}

}  // namespace xraycast
