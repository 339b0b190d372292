// Thin vessels in heavy noise: trees that grow at random, not those by which the filter's constants were
// chosen.
#include "support/grown_tree.hpp"
#include "support/tubes.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/evidence/ridge_detection.hpp"
#include "xraycast/evidence/ridge_tracking.hpp"
#include "xraycast/mask/components.hpp"
#include "xraycast/mask/distance_transform.hpp"
#include "xraycast/segmentation/centreline.hpp"
#include "xraycast/segmentation/segment.hpp"

#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace xraycast::ridges_cl_test {
namespace {

double nearest(const glm::dvec3& point, const std::vector<glm::dvec3>& points) {
  double best = 1e9;
  for (const glm::dvec3& p : points) best = std::min(best, glm::distance(point, p));
  return best;
}

/// The share of a mask's voxels that lie no farther than `voxels` from another mask.
double share_near(const Mask& mask, const Mask& other, double voxels) {
  const std::vector<float> away = distance_to_foreground_mm(other);
  std::int64_t near = 0;
  for (std::size_t i = 0; i < mask.voxels.size(); ++i) near += mask.voxels[i] != 0 && away[i] <= voxels;
  return static_cast<double>(near) / static_cast<double>(mask.count());
}

struct NoisyTree {
  std::uint32_t seed;
  double bend, noise, least_found;
};

class LineVessels : public testing::TestWithParam<NoisyTree> {};

TEST_P(LineVessels, AreFoundInNoise) {
  const auto [seed, bend, noise, least_found] = GetParam();
  const GrownTree tree = grow_tree({.seed = seed, .bend = bend, .noise = noise});
  ComputeDevice device;
  Progress progress;
  const Mask found = segment_vessels(tree.noisy, {}, "tree", device, progress).mask;
  constexpr double kCorner = 1.8;  // the diagonal of a voxel
  // Vessels are about a voxel thick: half a voxel off, and as much is wrong as right. But no noise makes them
  // wider or thinner: of the trees by which the limit was chosen none was off by more than 4 % in these.
  EXPECT_GE(share_near(found, tree.lumen, 0), 0.75);
  EXPECT_GE(share_near(tree.lumen, found, 0), 0.75);
  EXPECT_NEAR(static_cast<double>(found.count()) / static_cast<double>(tree.lumen.count()), 1, 0.05);
  EXPECT_GE(share_near(found, tree.lumen, kCorner), 0.95);
  EXPECT_GE(share_near(tree.lumen, found, kCorner), 0.85);

  const Centrelines centrelines = extract_centrelines(found, "tree");
  std::vector<glm::dvec3> points;
  for (const VesselBranch& branch : centrelines.tree.branches())
    for (const VesselPoint& point : branch.points) points.push_back(point.position_mm);
  const auto hits =
      std::ranges::count_if(tree.centreline, [&](const auto& p) { return nearest(p, points) < 2; });
  EXPECT_GE(static_cast<double>(hits) / static_cast<double>(tree.centreline.size()), least_found);
  double sum = 0;
  for (const glm::dvec3& p : points) sum += nearest(p, tree.centreline);
  EXPECT_LT(sum / static_cast<double>(points.size()), 0.75);
}

// A lumen as wide as a voxel's face has three quarters of it in its middle voxel: 190 over noise of 50
// and 75. In noise of 30 that is cut off at the background's level half of it is hidden.
INSTANTIATE_TEST_SUITE_P(Grown, LineVessels,
                         testing::Values(NoisyTree{21, 0, 50, 0.93}, NoisyTree{22, 0.1, 50, 0.93},
                                         NoisyTree{23, 0.1, 75, 0.77}, NoisyTree{24, 0, 30, 0.95}),
                         [](const auto& tree) { return "Tree" + std::to_string(tree.param.seed); });

Volume noise_alone(const Index3& size) {
  Volume volume({.size = size});
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0, 60);
  for (std::int16_t& value : volume.hu())
    value = static_cast<std::int16_t>(std::lround(std::clamp(noise(random), 0.0, 255.0)));
  return volume;
}

TEST(RidgeStrength, IsTheSameInAMirror) {
  // Eight voxels along x are computed at once: the last ones of a row are fewer.
  const Index3 size(21, 18, 19);
  const Volume volume = noise_alone(size);
  Volume mirrored(volume.geometry());
  std::ranges::reverse_copy(volume.hu(), mirrored.hu().begin());  // a point reflection
  ComputeDevice device;
  std::vector<float> strength = ridge_strength(volume, device),
                     mirrored_strength = ridge_strength(mirrored, device);
  std::ranges::reverse(mirrored_strength);
  // Sums of a hundred values in another order.
  for (std::size_t i = 0; i < strength.size(); ++i) ASSERT_NEAR(strength[i], mirrored_strength[i], 1e-3) << i;
}

TEST(NoiseAlone, CountsWhereAMaskHasLeftIt) {
  const Volume volume = noise_alone({60, 60, 60});
  Volume masked({.size = {60, 60, 60}});
  for (std::int64_t z = 20; z < 40; ++z)
    for (std::int64_t y = 20; y < 40; ++y)
      for (std::int64_t x = 20; x < 40; ++x) masked.at(x, y, z) = volume.at(x, y, z);
  ComputeDevice device;
  const double everywhere = strong_ridge(ridge_strength(volume, device)),
               left = strong_ridge(ridge_strength(masked, device));
  // The mean of what is left is brighter than what was masked. The median strength of all voxels is 0.
  EXPECT_GE(left, everywhere);
}

TEST(NoiseAlone, HoldsNoVessel) {
  const Volume volume = noise_alone({60, 60, 60});
  ComputeDevice device;
  Progress progress;
  EXPECT_THROW(segment_vessels(volume, {}, "noise", device, progress).mask, InputError);
}

TEST(NoiseAlone, SeldomLeadsOnFromAnEnd) {
  const Volume volume = noise_alone({80, 160, 160});
  const Mask lines = mask_where(volume.geometry(), [](const glm::dvec3& p) {
    return p.x >= 35 && p.x < 45 && std::fmod(p.y, 8) == 4 && std::fmod(p.z, 8) == 4;
  });
  ComputeDevice device;
  Progress progress;
  const Components ways(track_ridges(contrast_to_noise(volume, 0.7, device), lines));
  // Of 800 ends one in fifty, and three standard deviations of that number more.
  EXPECT_LE(ways.count(), 16 + 3 * 4);
}

TEST(LineEnds, AreFollowedWhereTheVesselGoesOn) {
  Volume volume = noise_alone({60, 40, 40});
  for (std::int64_t x = 5; x < 45; ++x) volume.at(x, 20, 20) = 255;
  const Mask start = mask_where(
      volume.geometry(), [](const glm::dvec3& p) { return p.x >= 5 && p.x < 15 && p.y == 20 && p.z == 20; });
  ComputeDevice device;
  Progress progress;
  const Mask ways = track_ridges(contrast_to_noise(volume, 0.7, device), start);
  for (std::int64_t x = 15; x < 44; ++x) EXPECT_TRUE(ways.at({x, 20, 20})) << x;
  EXPECT_FALSE(ways.at({48, 20, 20}));
}

TEST(LineEnds, AreFollowedOnceRoundARing) {
  Volume volume = noise_alone({60, 60, 30});
  const auto is_ring = [](const glm::dvec3& p) {
    return std::abs(std::hypot(p.x - 30, p.y - 30) - 15) < 1 && std::abs(p.z - 15) < 1;
  };
  for (std::int64_t z = 14; z < 17; ++z)
    for (std::int64_t y = 0; y < 60; ++y)
      for (std::int64_t x = 0; x < 60; ++x)
        if (is_ring({x, y, z})) volume.at(x, y, z) = 255;
  const Mask start = mask_where(volume.geometry(), [&](const glm::dvec3& p) {
    return is_ring(p) && p.z == 15 && p.x > 40 && std::abs(p.y - 30) < 6;
  });
  ComputeDevice device;
  Progress progress;
  const Mask ways = track_ridges(contrast_to_noise(volume, 0.7, device), start);
  std::int64_t opposite = 0;
  for (std::int64_t x = 13; x < 18; ++x) opposite += ways.at({x, 30, 15}) ? 1 : 0;
  EXPECT_GT(opposite, 0);
}

TEST(Skeleton, HasNoDeadEndsThatHardlyRise) {
  const VolumeGeometry grid{.size = {40, 40, 20}};
  const auto is_trunk = [](const glm::dvec3& p) { return p.y == 20 && p.z == 10 && p.x >= 5 && p.x < 35; };
  const auto is_branch = [](const glm::dvec3& p, double x) {
    return p.x == x && p.z == 10 && p.y > 20 && p.y < 30;
  };
  const Mask lines = mask_where(
      grid, [&](const glm::dvec3& p) { return is_trunk(p) || is_branch(p, 12) || is_branch(p, 28); });
  std::vector<float> rise(lines.voxels.size());
  for (std::size_t i = 0; i < rise.size(); ++i) {
    const glm::dvec3 p(voxel_at(grid, static_cast<std::int64_t>(i)));
    rise[i] = is_trunk(p) ? 10 : is_branch(p, 12) ? 3 : is_branch(p, 28) ? 2 : 0;
  }
  const Mask vessels = pruned_skeleton(lines, rise).kept;
  EXPECT_TRUE(vessels.at({6, 20, 10}));
  EXPECT_TRUE(vessels.at({12, 28, 10}));
  for (std::int64_t y = 23; y < 30; ++y) EXPECT_FALSE(vessels.at({28, y, 10})) << y;
}

TEST(LineStrength, EndsWithTheLineAndHasNoHalo) {
  Volume volume({.size = {40, 40, 40}});
  std::ranges::fill(volume.hu(), 0);
  for (std::int64_t x = 0; x < 20; ++x) volume.at(x, 20, 20) = 1000;
  ComputeDevice device;
  const std::vector<float> strength = ridge_strength(volume, device);
  const auto at = [&](std::int64_t x, std::int64_t y) {
    return strength[static_cast<std::size_t>((20 * 40 + y) * 40 + x)];
  };
  EXPECT_GT(at(10, 20), 200);
  // Beyond the end, and beside it, one arm at least lies in the dark; the filter's own width is half a voxel.
  EXPECT_LT(at(23, 20), 0.1F * at(10, 20));
  EXPECT_LT(at(10, 23), 0.1F * at(10, 20));
}

}  // namespace
}  // namespace xraycast::ridges_cl_test
