#include "xraycast/segmentation/watershed.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/parallel.hpp"
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
Index3 coarsening(const glm::dvec3& spacing_mm) {
  return glm::max(Index3(1), Index3(glm::round(kGrid_mm / spacing_mm)));
}

/// A coarse voxel is inside where half of its voxels are.
Mask coarse(const Mask& mask, const Index3& step) {
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

/// The mask with what a ball of that radius closes: everywhere it holds, or is nearer to, than it reaches.
Mask dilated(const Mask& mask, double radius_mm) {
  const std::vector<float> away_mm = distance_to_mm(mask);
  Mask result(mask.geometry);
  for (std::size_t i = 0; i < away_mm.size(); ++i) result.voxels[i] = away_mm[i] <= radius_mm;
  return result;
}

/// How much nearer the wall is than the middle of the next voxel outside.
double half_voxel_mm(const VolumeGeometry& grid) {
  const glm::dvec3 s = grid.spacing_mm;
  return 0.5 * std::max({s.x, s.y, s.z});
}

/// What lies in a sphere larger than `max_radius_mm` that fits in, once the trabeculae and papillary muscles
/// of a heart chamber are closed.
Mask in_wide_spheres(const Mask& mask, double max_radius_mm) {
  constexpr double kMuscle_mm = 4;
  const std::vector<float> closed_mm = distance_to_outside_mm(dilated(mask, kMuscle_mm));
  Mask centres(mask.geometry);
  for (std::size_t i = 0; i < closed_mm.size(); ++i)
    centres.voxels[i] = closed_mm[i] > max_radius_mm + kMuscle_mm;
  return centres.count() > 0 ? dilated(centres, max_radius_mm) : centres;
}

/// The voxels of a mask, the deepest first.
std::vector<std::size_t> deepest_first(const Mask& mask, const std::vector<float>& distance_mm) {
  std::vector<std::size_t> order;
  for (std::size_t i = 0; i < mask.voxels.size(); ++i)
    if (mask.voxels[i] != 0) order.push_back(i);
  std::ranges::stable_sort(order,
                           [&](std::size_t a, std::size_t b) { return distance_mm[a] > distance_mm[b]; });
  return order;
}

/// What a basin is known to be.
enum class Kind : std::uint8_t { open, vessel, chamber };

/// Floods a mask from its thickest places on, in the order of falling distance. Where two basins meet, the
/// neck between them decides: basins of one vessel have a neck about as wide as the narrower one of them,
/// things that only touch a narrow one.
class MarkerWatershed {
 public:
  /// Basins that `whole` has parted stay apart.
  MarkerWatershed(const Mask& mask, const std::vector<float>& distance_mm, MarkerWatershed* whole = nullptr)
      : mask_(mask), distance_mm_(distance_mm), whole_(whole), basin_of_(mask.voxels.size(), -1) {
    half_voxel_mm_ = static_cast<float>(half_voxel_mm(mask.geometry));
  }

  void mark(std::size_t voxel, Kind kind) { markers_[voxel] = kind; }

  /// `order`: the mask's voxels, the deepest first.
  void run(const std::vector<std::size_t>& order) {
    for (const std::size_t at : order) flood(at);
  }

  /// The basin of a voxel of the mask, the same number for all basins that became one.
  int basin(std::size_t at) { return find(basin_of_[at]); }
  bool is_chamber(int basin) const { return basins_[static_cast<std::size_t>(basin)].kind == Kind::chamber; }

  /// The deepest voxel of the basin that a voxel's water runs into, before any became one.
  std::size_t top(std::size_t at) const { return basins_[static_cast<std::size_t>(basin_of_[at])].top; }

 private:
  struct Basin {
    int parent;
    std::size_t top;
    float top_mm;
    Kind kind;
  };

  int find(int b) {
    while (basins_[static_cast<std::size_t>(b)].parent != b)
      b = basins_[static_cast<std::size_t>(b)].parent =
          basins_[static_cast<std::size_t>(basins_[static_cast<std::size_t>(b)].parent)].parent;
    return b;
  }

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
    // The basin uphill takes the voxel; the others come to it, or it to them, where the neck is wide.
    const auto marker = markers_.find(at);
    const Kind kind = marker == markers_.end() ? Kind::open : marker->second;
    if (count == 0 ||
        (kind != Kind::open && !agree(kind, basins_[static_cast<std::size_t>(around[0])].kind))) {
      basin_of_[at] = static_cast<int>(basins_.size());
      basins_.push_back({basin_of_[at], at, distance_mm_[at], kind});
      return;
    }
    basin_of_[at] = basin_of_[uphill];
    if (kind != Kind::open) basins_[static_cast<std::size_t>(around[0])].kind = kind;
    for (std::size_t i = 1; i < count; ++i) join(find(around[0]), find(around[i]), distance_mm_[at]);
  }

  static bool agree(Kind a, Kind b) { return a == Kind::open || b == Kind::open || a == b; }

  void join(int higher, int lower, float neck_mm) {
    if (higher == lower) return;
    if (basins_[static_cast<std::size_t>(higher)].top_mm < basins_[static_cast<std::size_t>(lower)].top_mm)
      std::swap(higher, lower);
    constexpr float kOneVessel = 0.5F;  // a stenosis halves the diameter
    constexpr float kNoVessel = 0.97F;  // a bulge in a chamber's wall
    Basin &a = basins_[static_cast<std::size_t>(higher)], &b = basins_[static_cast<std::size_t>(lower)];
    if (whole_ != nullptr && whole_->basin(a.top) != whole_->basin(b.top)) return;
    if (a.kind != b.kind && a.kind != Kind::open && b.kind != Kind::open) return;
    const bool chamber = a.kind == Kind::chamber || b.kind == Kind::chamber;
    const Basin& open = a.kind == Kind::chamber ? b : a;
    if (chamber && a.kind != b.kind ? neck_mm < kNoVessel * open.top_mm
                                    : neck_mm + half_voxel_mm_ < kOneVessel * b.top_mm)
      return;
    b.parent = higher;
    if (a.kind == Kind::open) a.kind = b.kind;
  }

  const Mask& mask_;
  const std::vector<float>& distance_mm_;
  MarkerWatershed* whole_;
  float half_voxel_mm_;  ///< to which distances are known
  std::vector<int> basin_of_;
  std::vector<Basin> basins_;
  std::unordered_map<std::size_t, Kind> markers_;
};

/// The tops of the basins that are a chamber's: most of what runs into them is in spheres larger than
/// `max_radius_mm`, or they are that deep themselves.
std::vector<std::size_t> chamber_tops(const Mask& mask, const std::vector<float>& distance_mm,
                                      const MarkerWatershed& flooding, double max_radius_mm) {
  const Mask wide = in_wide_spheres(mask, max_radius_mm);
  std::unordered_map<std::size_t, std::int64_t> majority;
  for (std::size_t i = 0; i < mask.voxels.size(); ++i)
    if (mask.voxels[i] != 0) majority[flooding.top(i)] += wide.voxels[i] != 0 ? 1 : -1;
  const double deepest_mm = max_radius_mm + half_voxel_mm(mask.geometry);
  std::vector<std::size_t> tops;
  for (const auto& [top, votes] : majority)
    if (votes > 0 || distance_mm[top] > deepest_mm) tops.push_back(top);
  return tops;
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
        "{}: the point ({:.1f}, {:.1f}, {:.1f}) mm is not in anything bright; look up its place in the scan",
        name, point_mm.x, point_mm.y, point_mm.z);
  return best;
}

void part_from_chambers(Mask& mask, const Markers& markers, const std::string& name, Progress& progress) {
  progress.begin("parting chambers", 4, "passes");
  for (const auto* points : {&markers.vessels_mm, &markers.not_vessels_mm})
    for (const glm::dvec3& point : *points)
      nearest_voxel(mask, point, name);  // complains where there is none

  const Box box = grown(bounding_box(mask), 2, mask.geometry.size);
  if (box.empty()) return;
  const Index3 step = coarsening(mask.geometry.spacing_mm);
  Mask part = crop(mask, box);
  const Mask grid = coarse(part, step);
  const std::vector<float> distance_mm = distance_to_outside_mm(grid);

  progress.advance();

  // What only touches is parted before chambers are known: it must not depend on what they are.
  const std::vector<std::size_t> order = deepest_first(grid, distance_mm);
  MarkerWatershed whole(grid, distance_mm);
  whole.run(order);
  MarkerWatershed flooding(grid, distance_mm, &whole);
  for (const std::size_t top : chamber_tops(grid, distance_mm, whole, markers.max_radius_mm))
    flooding.mark(top, Kind::chamber);
  for (const auto& [points, kind] :
       {std::pair(&markers.vessels_mm, Kind::vessel), std::pair(&markers.not_vessels_mm, Kind::chamber)})
    for (const glm::dvec3& point : *points) {
      const Index3 voxel = (nearest_voxel(mask, point, name) - box.lower) / step;
      if (grid.at(voxel)) flooding.mark(grid.offset(voxel), kind);
    }
  progress.advance();
  flooding.run(order);
  progress.advance();

  // Chambers go, and of two basins that touch the one with the higher number gives up the voxels between.
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
