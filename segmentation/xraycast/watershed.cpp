#include "xraycast/watershed.hpp"

#include "xraycast/components.hpp"
#include "xraycast/distance_transform.hpp"
#include "xraycast/error.hpp"
#include "xraycast/parallel.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <itkImage.h>
#include <itkMorphologicalWatershedFromMarkersImageFilter.h>

#include <algorithm>
#include <cmath>

namespace xraycast {
namespace {

constexpr double kGrid_mm = 1.5;
enum Label : std::uint8_t { kNone = 0, kOutside = 1, kVessel = 2, kChamber = 3 };

using Levels = itk::Image<std::int16_t, 3>;
using Labels = itk::Image<std::uint8_t, 3>;

template <typename ImageType>
typename ImageType::Pointer image_of(const Index3& size) {
  auto image = ImageType::New();
  typename ImageType::SizeType extent;
  for (unsigned axis = 0; axis < 3; ++axis)
    extent[axis] = static_cast<itk::SizeValueType>(size[static_cast<int>(axis)]);
  image->SetRegions(extent);
  image->Allocate(true);
  return image;
}

/// How many voxels become one, along each axis.
Index3 coarsening(const glm::dvec3& spacing_mm) {
  return glm::max(Index3(1), Index3(glm::floor(kGrid_mm / spacing_mm + 1e-6)));
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

/// Regional maxima of the distance that rise `least_mm` above the necks around them, in descending order of
/// their height: flooding from above, a basin that meets a higher one after having risen less is no peak.
std::vector<Index3> peaks(const Mask& mask, const std::vector<float>& distance_mm, double least_mm) {
  std::vector<std::size_t> order;
  for (std::size_t i = 0; i < mask.voxels.size(); ++i)
    if (mask.voxels[i] != 0) order.push_back(i);
  std::ranges::stable_sort(order,
                           [&](std::size_t a, std::size_t b) { return distance_mm[a] > distance_mm[b]; });
  std::vector<std::int32_t> basin(mask.voxels.size(), -1);
  std::vector<std::int32_t> parent;
  std::vector<std::size_t> top;
  std::vector<bool> is_peak;
  const auto find = [&](std::int32_t b) {
    while (parent[static_cast<std::size_t>(b)] != b)
      b = parent[static_cast<std::size_t>(b)] =
          parent[static_cast<std::size_t>(parent[static_cast<std::size_t>(b)])];
    return b;
  };
  const Index3 size = mask.geometry.size;
  const auto index_of = [&](std::size_t at) {
    const auto o = static_cast<std::int64_t>(at);
    return Index3(o % size.x, o / size.x % size.y, o / (size.x * size.y));
  };
  for (const std::size_t at : order) {
    const Index3 here = index_of(at);
    std::int32_t mine = -1;
    for (const Index3& step : kNeighbours) {
      if (!mask.at(here + step)) continue;
      const std::int32_t near = basin[mask.offset(here + step)];
      if (near < 0) continue;
      const std::int32_t other = find(near);
      if (mine < 0) {
        mine = other;
      } else if (other != mine) {
        const auto higher = static_cast<std::size_t>(std::min(mine, other)),
                   lower = static_cast<std::size_t>(std::max(mine, other));
        if (distance_mm[top[lower]] - distance_mm[at] < least_mm) is_peak[lower] = false;
        parent[lower] = static_cast<std::int32_t>(higher);
        mine = static_cast<std::int32_t>(higher);
      }
    }
    if (mine < 0) {
      mine = static_cast<std::int32_t>(parent.size());
      parent.push_back(mine);
      top.push_back(at);
      is_peak.push_back(true);
    }
    basin[at] = mine;
  }
  std::vector<Index3> result;
  for (std::size_t b = 0; b < top.size(); ++b)
    if (is_peak[b]) result.push_back(index_of(top[b]));
  return result;
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

void part_from_chambers(Mask& mask, const Markers& markers, const std::string& name) {
  for (const auto* points : {&markers.vessels_mm, &markers.not_vessels_mm})
    for (const glm::dvec3& point : *points)
      nearest_voxel(mask, point, name);  // complains where there is none

  const Box box = grown(bounding_box(mask), 2, mask.geometry.size);
  if (box.empty()) return;
  const Index3 step = coarsening(mask.geometry.spacing_mm);
  Mask part = crop(mask, box);
  const Mask grid = coarse(part, step);
  const std::vector<float> distance_mm = distance_to_outside_mm(grid);
  const bool has_chamber =
      std::ranges::any_of(distance_mm, [&](float mm) { return mm > markers.max_radius_mm; });
  if (!has_chamber && markers.not_vessels_mm.empty()) return;

  // Levels in tenths of a millimetre, deepest where the distance is largest.
  const Index3 size = grid.geometry.size;
  const auto levels = image_of<Levels>(size);
  const auto labels = image_of<Labels>(size);
  std::int16_t* level = levels->GetBufferPointer();
  std::uint8_t* label = labels->GetBufferPointer();
  for (std::size_t i = 0; i < distance_mm.size(); ++i) {
    level[i] = static_cast<std::int16_t>(-std::min(3000.0F, 10 * distance_mm[i]));
    if (grid.voxels[i] == 0) label[i] = kOutside;
    if (distance_mm[i] > markers.max_radius_mm) label[i] = kChamber;
  }
  constexpr double kRise_mm = 2;  // less is the roughness of a surface
  if (markers.vessels_mm.empty())
    for (const Index3& peak : peaks(grid, distance_mm, kRise_mm))
      if (std::uint8_t& at = label[grid.offset(peak)]; at == kNone) at = kVessel;
  for (const auto& [points, kind] :
       {std::pair(&markers.vessels_mm, kVessel), std::pair(&markers.not_vessels_mm, kChamber)})
    for (const glm::dvec3& point : *points) {
      const Index3 fine = nearest_voxel(mask, point, name) - box.lower;
      label[grid.offset(fine / step)] = kind;
    }

  const auto watershed = itk::MorphologicalWatershedFromMarkersImageFilter<Levels, Labels>::New();
  watershed->SetInput1(levels);
  watershed->SetInput2(labels);
  watershed->SetMarkWatershedLine(false);
  watershed->SetFullyConnected(true);
  watershed->Update();
  const std::uint8_t* flooded = watershed->GetOutput()->GetBufferPointer();
  parallel_for(part.geometry.size.z, [&](std::int64_t z) {
    for (std::int64_t y = 0; y < part.geometry.size.y; ++y)
      for (std::int64_t x = 0; x < part.geometry.size.x; ++x)
        if (flooded[grid.offset(Index3(x, y, z) / step)] == kChamber) part[{x, y, z}] = 0;
  });
  paste(part, box, mask);
}

}  // namespace xraycast
