// Trees of 216 ends, with radii from half a voxel to three, in noise and blur: none of them is one of those
// by which constants were chosen.
#include "support/grown_tree.hpp"
#include "xraycast/evidence/block_filter.hpp"
#include "xraycast/mask/components.hpp"
#include "xraycast/segmentation/centreline.hpp"
#include "xraycast/segmentation/segment.hpp"
#include "xraycast/segmentation/surface.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

namespace xraycast::grown_trees_test {
namespace {

constexpr std::uint32_t kSeeds[] = {61, 62, 63, 64, 65, 66};

GrownTree tree_of(std::uint32_t seed, double noise, double blur) {
  return grow_tree(
      {.seed = seed, .ends = 216, .bend = seed % 2 == 0 ? 0.1 : 0.0, .noise = noise, .blur = blur});
}

struct Agreement {
  double precision, recall;
  double mean() const { return 0.5 * (precision + recall); }
};

Agreement agreement(const Mask& found, const Mask& truth) {
  std::int64_t both = 0;
  for (std::size_t i = 0; i < truth.voxels.size(); ++i) both += found.voxels[i] & truth.voxels[i];
  const auto share = [&](const Mask& of) {
    return static_cast<double>(both) / static_cast<double>(std::max<std::int64_t>(of.count(), 1));
  };
  return {share(found), share(truth)};
}

/// The voxels that a line crosses, each once.
std::vector<glm::dvec3> voxels_on(const std::vector<glm::dvec3>& line, const VolumeGeometry& grid) {
  Mask crossed(grid);
  for (const glm::dvec3& p : line) crossed[Index3(glm::round(p))] = 1;
  std::vector<glm::dvec3> voxels;
  for (std::size_t i = 0; i < crossed.voxels.size(); ++i)
    if (crossed.voxels[i] != 0) voxels.emplace_back(voxel_at(grid, static_cast<std::int64_t>(i)));
  return voxels;
}

double nearest_of(const glm::dvec3& point, const std::vector<glm::dvec3>& points) {
  double best2 = 1e9;
  for (const glm::dvec3& p : points) best2 = std::min(best2, glm::dot(p - point, p - point));
  return std::sqrt(best2);
}

/// What is measured of a tree's lines.
struct Lines {
  double found, off, volume, length, false_length;
};

Lines lines_of(const VesselTree& tree, const std::vector<glm::dvec3>& truth) {
  Lines lines{};
  std::vector<glm::dvec3> points;
  double off = 0;
  for (const VesselBranch& branch : tree.branches())
    for (std::size_t i = 0; i < branch.points.size(); ++i) {
      const VesselPoint& here = branch.points[i];
      const double away = nearest_of(here.position_mm, truth);
      points.push_back(here.position_mm);
      off += away;
      if (i == 0) continue;
      const VesselPoint& before = branch.points[i - 1];
      const double length = glm::distance(here.position_mm, before.position_mm), a = before.radius_mm,
                   b = here.radius_mm;
      lines.length += length;
      lines.volume += std::numbers::pi * length * (a * a + a * b + b * b) / 3;
      if (away > 2.5) lines.false_length += length;  // a voxel's middle is half a voxel from its line
    }
  const auto hits =
      std::ranges::count_if(truth, [&](const glm::dvec3& p) { return nearest_of(p, points) < 2; });
  lines.found = static_cast<double>(hits) / static_cast<double>(truth.size());
  lines.off = off / static_cast<double>(points.size());
  return lines;
}

struct Conditions {
  double noise, blur;
};

std::string name_of(const testing::TestParamInfo<Conditions>& at) {
  return "Noise" + std::to_string(static_cast<int>(at.param.noise)) + "Blur" +
         std::to_string(static_cast<int>(10 * at.param.blur));
}

class QuietTrees : public testing::TestWithParam<Conditions> {};

TEST_P(QuietTrees, AreWholeAndAsThickAsTheyAre) {
  ComputeDevice device;
  Progress progress;
  double found = 0, off = 0, radii = 0, fill = 0;
  for (const std::uint32_t seed : kSeeds) {
    SCOPED_TRACE(seed);
    const GrownTree tree = tree_of(seed, GetParam().noise, GetParam().blur);
    const SegmentedVessels vessels = segment_vessels(tree.noisy, {}, "tree", device, progress);
    const auto [precision, recall] = agreement(vessels.mask, tree.lumen);
    // A vessel of half a voxel fills a fourteenth of voxels that noise of 25 hides as often as not.
    EXPECT_GE(precision, 0.85);
    EXPECT_GE(recall, 0.85);
    const Centrelines lines = extract_centrelines(vessels.mask, "tree", progress, {}, &vessels.fill);
    const Lines measured = lines_of(lines.tree, voxels_on(tree.centreline, tree.noisy.geometry()));
    EXPECT_GE(measured.found, 0.955);
    found += measured.found / std::size(kSeeds);
    off += measured.off / std::size(kSeeds);
    radii += measured.volume / tree.lumen_voxels / std::size(kSeeds);
    fill += vessels.fill.volume_mm3() / tree.lumen_voxels / std::size(kSeeds);
    // Of vessels one voxel wide it changes by some per cent with a hundredth of the level.
    constexpr std::size_t kTriangles = 200'000;
    EXPECT_NEAR(volume_mm3(surface_of(vessels.mask, vessels.fill, kTriangles)) / vessels.fill.volume_mm3(), 1,
                0.06);
  }
  // A branch of four voxels may hide in its parent's side; even the true line is 0.48 off its own voxels.
  EXPECT_GE(found, 0.97);
  EXPECT_LE(off, 0.58);
  EXPECT_NEAR(radii, 1, 0.1);
  EXPECT_NEAR(fill, 1, 0.1);
}

INSTANTIATE_TEST_SUITE_P(Sharp, QuietTrees,
                         testing::Values(Conditions{5, 0}, Conditions{11, 0}, Conditions{25, 0}), name_of);
INSTANTIATE_TEST_SUITE_P(Blurred, QuietTrees, testing::Values(Conditions{5, 0.5}, Conditions{11, 0.5}),
                         name_of);

/// 0.795 at noise of 75 when this was written; by an oracle that knows the paths 0.85 to 0.87.
struct NoisyConditions {
  double noise, least_found;
};

class NoisyTrees : public testing::TestWithParam<NoisyConditions> {};

TEST_P(NoisyTrees, AreFound) {
  ComputeDevice device;
  Progress progress;
  double found = 0, wrong = 0, length = 0;
  for (const std::uint32_t seed : kSeeds) {
    const GrownTree tree = tree_of(seed, GetParam().noise, 0);
    const SegmentedVessels vessels = segment_vessels(tree.noisy, {}, "tree", device, progress);
    const Centrelines lines = extract_centrelines(vessels.mask, "tree", progress, {}, &vessels.fill);
    const Lines measured = lines_of(lines.tree, voxels_on(tree.centreline, tree.noisy.geometry()));
    found += measured.found / std::size(kSeeds);
    wrong += measured.false_length;
    length += measured.length;
  }
  EXPECT_GE(found, GetParam().least_found);
  EXPECT_LE(wrong, 0.02 * length);
}

INSTANTIATE_TEST_SUITE_P(Heavy, NoisyTrees,
                         testing::Values(NoisyConditions{50, 0.94}, NoisyConditions{75, 0.79}),
                         [](const auto& at) {
                           return "Noise" + std::to_string(static_cast<int>(at.param.noise));
                         });

/// A tree whose voxels are full of lumen or empty, as scans of coarse phantoms and of masks are.
GrownTree without_partial_volume(GrownTree tree, double noise) {
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  for (std::size_t i = 0; i < tree.lumen.voxels.size(); ++i)
    tree.noisy.hu()[i] = static_cast<std::int16_t>(
        std::lround(std::clamp(255 * tree.lumen.voxels[i] + noise * normal(random), 0.0, 255.0)));
  return tree;
}

TEST(TreesWithoutPartialVolume, AreNotWiderThanTheyAre) {
  ComputeDevice device;
  Progress progress;
  for (const double noise : {0.0, 10.0, 20.0, 50.0, 75.0}) {
    const GrownTree tree = without_partial_volume(tree_of(kSeeds[0], 0, 0), noise);
    const auto [precision, recall] =
        agreement(segment_vessels(tree.noisy, {}, "tree", device, progress).mask, tree.lumen);
    // Precision was 0.55 to 0.67 from noise of 10 on while their voxels were smoothed. In noise of 75, a
    // third of the contrast, the best threshold has 0.96.
    EXPECT_GE(precision, noise <= 20 ? 0.98 : 0.88) << noise;
    EXPECT_GE(recall, noise <= 20 ? 0.98 : 0.93) << noise;
  }
}

/// The best mean of precision and recall of a Gaussian, one threshold and the largest component.
double best_of_thresholds(const GrownTree& tree, ComputeDevice& device) {
  double best = 0;
  for (const double sigma_vox : {0.0, 0.5, 1.0}) {
    const std::vector<float> values =
        filtered(tree.noisy, device, 3, [&](BlockFilter& block, const cl::Buffer& hu) {
          return sigma_vox > 0 ? block.smooth(hu, glm::dvec3(sigma_vox)) : hu;
        });
    for (float threshold = 4; threshold < 130; threshold *= 1.12F) {
      Mask mask(tree.lumen.geometry);
      std::ranges::transform(values, mask.voxels.begin(),
                             [&](float v) { return static_cast<std::uint8_t>(v > threshold); });
      const Components components(mask);
      if (components.count() == 0) continue;
      std::vector<bool> keep(static_cast<std::size_t>(components.count()));
      keep[static_cast<std::size_t>(components.largest())] = true;
      best = std::max(best, agreement(components.select(keep), tree.lumen).mean());
    }
  }
  return best;
}

class TreesByThreshold : public testing::TestWithParam<Conditions> {};

TEST_P(TreesByThreshold, AreNeverBetter) {
  ComputeDevice device;
  Progress progress;
  for (const std::uint32_t seed : kSeeds) {
    const GrownTree tree = tree_of(seed, GetParam().noise, GetParam().blur);
    const Mask mask = segment_vessels(tree.noisy, {}, "tree", device, progress).mask;
    EXPECT_GE(agreement(mask, tree.lumen).mean(), best_of_thresholds(tree, device)) << seed;
  }
}

INSTANTIATE_TEST_SUITE_P(UpToNoise25, TreesByThreshold,
                         testing::Values(Conditions{5, 0}, Conditions{11, 0}, Conditions{25, 0},
                                         Conditions{5, 0.5}, Conditions{11, 0.5}, Conditions{25, 0.5},
                                         Conditions{5, 1}, Conditions{25, 1}),
                         name_of);

}  // namespace
}  // namespace xraycast::grown_trees_test
