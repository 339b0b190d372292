#include "xraycast/radii/tube_samples.hpp"

#include "xraycast/base/parallel.hpp"
#include "xraycast/evidence/place_in_tube.hpp"
#include "xraycast/mask/mask.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>

namespace xraycast {
namespace {

struct VoxelOfBranch {
  std::int64_t voxel;
  double distance_mm, out_mm;
  TubeSample sample;
};

/// The voxels about a piece of a branch: between the planes across its ends, and a little beyond, as in a
/// bend there is room between two pieces.
void add_piece(const VesselBranch& branch, std::size_t piece, const Volume& volume, double beyond_mm,
               std::vector<VoxelOfBranch>& found) {
  constexpr double kRoom_vox = 0.5;
  const VesselPoint &a = branch.points[piece], &b = branch.points[piece + 1];
  const VolumeGeometry& grid = volume.geometry();
  const glm::dvec3 along = glm::normalize(b.position_mm - a.position_mm);
  const double length_mm = glm::distance(a.position_mm, b.position_mm),
               room_mm = kRoom_vox * std::cbrt(grid.spacing_mm.x * grid.spacing_mm.y * grid.spacing_mm.z);
  const glm::dvec3 reach = (std::max(a.radius_mm, b.radius_mm) + beyond_mm) / grid.spacing_mm,
                   from = grid.to_index(a.position_mm), to = grid.to_index(b.position_mm);
  const Index3 lower = glm::max(Index3(glm::ceil(glm::min(from, to) - reach)), Index3(0)),
               upper = glm::min(Index3(glm::floor(glm::max(from, to) + reach)), grid.size - Index3(1));
  const bool is_first = piece == 0, is_last = piece + 2 == branch.points.size();
  for (std::int64_t z = lower.z; z <= upper.z; ++z)
    for (std::int64_t y = lower.y; y <= upper.y; ++y)
      for (std::int64_t x = lower.x; x <= upper.x; ++x) {
        const glm::dvec3 p = grid.to_world_mm(glm::dvec3(x, y, z));
        if (const double mm = glm::dot(p - a.position_mm, along); mm < -room_mm || mm > length_mm + room_mm)
          continue;
        const PlaceInTube place = place_in_tube(p, a, b);
        // What lies before or after the branch is beside none of its places.
        if ((is_first && place.fraction <= 0) || (is_last && place.fraction >= 1)) continue;
        if (std::abs(place.out_mm()) > beyond_mm) continue;
        const double along_mm =
            std::lerp(branch.arc_length_mm[piece], branch.arc_length_mm[piece + 1], place.fraction);
        found.push_back({static_cast<std::int64_t>(offset_of(grid, {x, y, z})),
                         glm::length(place.from_axis_mm),
                         place.out_mm(),
                         {along_mm, place.from_axis_mm, static_cast<double>(volume.at(x, y, z))}});
      }
}

/// The voxels about a branch, each at the place of its line that is nearest, in the order of voxels.
std::vector<VoxelOfBranch> voxels_about(const VesselBranch& branch, const Volume& volume,
                                        const SampleReach& reach) {
  std::vector<VoxelOfBranch> found;
  for (std::size_t piece = 0; piece + 1 < branch.points.size(); ++piece) {
    check_cancelled();
    if (branch.points[piece].radius_mm < reach.widest_mm)
      add_piece(branch, piece, volume, reach.beyond_mm, found);
  }
  const auto before = [](const VoxelOfBranch& a, const VoxelOfBranch& b) {
    return a.voxel != b.voxel ? a.voxel < b.voxel : a.distance_mm < b.distance_mm;
  };
  std::ranges::sort(found, before);
  const auto is_same = [](const VoxelOfBranch& a, const VoxelOfBranch& b) { return a.voxel == b.voxel; };
  found.erase(std::unique(found.begin(), found.end(), is_same), found.end());
  return found;
}

/// A voxel about a branch, beside others of it.
struct Claim {
  std::int64_t voxel;
  std::int32_t branch, at;  ///< in the branch's list
  float out_mm;
};

}  // namespace

std::vector<std::vector<TubeSample>> tube_samples(const VesselTree& tree, const Volume& volume,
                                                  const SampleReach& reach) {
  const std::vector<VesselBranch>& branches = tree.branches();
  std::vector<std::vector<VoxelOfBranch>> about(branches.size());
  parallel_for(std::ssize(branches), [&](std::int64_t b) {
    const auto at = static_cast<std::size_t>(b);
    about[at] = voxels_about(branches[at], volume, reach);
  });

  std::vector<Claim> claims;
  for (std::size_t b = 0; b < about.size(); ++b)
    for (std::size_t i = 0; i < about[b].size(); ++i)
      claims.push_back({about[b][i].voxel, static_cast<std::int32_t>(b), static_cast<std::int32_t>(i),
                        static_cast<float>(about[b][i].out_mm)});
  std::ranges::sort(claims, {}, [](const Claim& claim) { return std::pair(claim.voxel, claim.branch); });

  std::vector<std::vector<TubeSample>> samples(branches.size());
  for (auto first = claims.begin(); first != claims.end();) {
    const auto last =
        std::find_if(first, claims.end(), [&](const Claim& c) { return c.voxel != first->voxel; });
    for (auto own = first; own != last; ++own) {
      const bool is_shared = std::any_of(first, last, [&](const Claim& other) {
        return other.branch != own->branch &&
               (other.out_mm <= own->out_mm || static_cast<double>(other.out_mm) < reach.apart_mm);
      });
      const auto branch = static_cast<std::size_t>(own->branch);
      if (!is_shared) samples[branch].push_back(about[branch][static_cast<std::size_t>(own->at)].sample);
    }
    first = last;
  }
  parallel_for(std::ssize(samples), [&](std::int64_t b) {
    std::ranges::stable_sort(samples[static_cast<std::size_t>(b)], {}, &TubeSample::along_mm);
  });
  return samples;
}

}  // namespace xraycast
