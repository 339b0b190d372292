// What segmentation finds in the phantoms against what was painted, at mild and at heavy noise.
#include "xraycast/base/error.hpp"
#include "xraycast/opencl/compute_device.hpp"
#include "xraycast/phantom/phantom.hpp"
#include "xraycast/segmentation/centreline.hpp"
#include "xraycast/segmentation/segment.hpp"

#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <set>

namespace xraycast::phantom_vessels_test {
namespace {

struct Case {
  std::string name, phantom;
  std::optional<double> noise_hu;
  double least_dice;
};

struct Result {
  Phantom phantom;
  Mask mask;
};

Result segmented(const std::string& name, std::optional<double> noise_hu, std::optional<Index3> size) {
  ComputeDevice device;
  Progress progress;
  Phantom phantom = make_phantom(name, {.size = size, .noise_hu = noise_hu});
  Mask mask = segment_vessels(generate(phantom, device, progress), {}, name, device, progress).mask;
  return {std::move(phantom), std::move(mask)};
}

double dice(const Result& result) {
  const std::vector<std::uint8_t> truth = vessel_mask(result.phantom);
  std::int64_t both = 0, all = 0;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    both += truth[i] & result.mask.voxels[i];
    all += truth[i] + result.mask.voxels[i];
  }
  return 2 * static_cast<double>(both) / static_cast<double>(all);
}

/// For each branch of `found`, the branches of `truth` along which it runs for three radii or more.
std::vector<std::set<int>> covered(const VesselTree& found, const VesselTree& truth) {
  std::vector<std::set<int>> result;
  for (const VesselBranch& branch : found.branches()) {
    std::map<int, double> length_mm;
    std::map<int, double> radius_mm;
    for (std::size_t i = 1; i < branch.points.size(); ++i) {
      const VesselTree::Location at = truth.nearest(branch.points[i].position_mm);
      length_mm[at.branch] += glm::distance(branch.points[i - 1].position_mm, branch.points[i].position_mm);
      radius_mm[at.branch] = std::max(radius_mm[at.branch], at.radius_mm);
    }
    result.emplace_back();
    for (const auto& [id, mm] : length_mm)
      if (mm > 3 * radius_mm[id]) result.back().insert(id);
  }
  return result;
}

// 1.04 mm: from the aorta down to the renal arteries, of 2.2 mm, all vessels have a radius of two voxels.
constexpr Index3 kThorax{384, 384, 540};

class ThoraxVessels : public testing::TestWithParam<std::pair<std::optional<double>, double>> {};

TEST_P(ThoraxVessels, AreThePaintedOnes) {
  const auto [noise_hu, least_dice] = GetParam();
  const Result result = segmented("thorax", noise_hu, kThorax);
  EXPECT_GE(dice(result), least_dice);

  const VesselTree truth(result.phantom.vessel_branches(), "truth");
  const Centrelines found = extract_centrelines(result.mask, "thorax");
  EXPECT_TRUE(found.loops.empty());
  EXPECT_TRUE(found.gaps_mm.empty());
  // Every branch but the shortest is found, and two meet where two met; a branch shorter than it is wide is a
  // matter of taste, and so is whether it parts a bifurcation in two.
  const std::vector<std::set<int>> covers = covered(found.tree, truth);
  std::set<int> seen;
  for (const std::set<int>& ids : covers) seen.insert(ids.begin(), ids.end());
  const double voxel_mm = result.phantom.geometry().spacing_mm.x;
  for (int id = 0; id < static_cast<int>(truth.branches().size()); ++id) {
    const VesselBranch& branch = truth.branches()[static_cast<std::size_t>(id)];
    double thickest_mm = 0;
    for (const VesselPoint& point : branch.points) thickest_mm = std::max(thickest_mm, point.radius_mm);
    if (thickest_mm < 2 * voxel_mm || branch.arc_length_mm.back() < 3 * thickest_mm) continue;
    EXPECT_TRUE(seen.contains(id)) << id;
  }
  const auto bifurcations = [](const VesselTree& tree) {
    std::vector<glm::dvec3> places;
    for (const VesselBranch& branch : tree.branches())
      if (branch.children.size() >= 2) places.push_back(branch.points.back().position_mm);
    return places;
  };
  if (noise_hu) {
    // Where the scan ends within the shoulders, spongy bone passes for a few branches more.
    EXPECT_LE(found.tree.branches().size(), truth.branches().size() + 8);
  } else {
    EXPECT_EQ(found.tree.branches().size(), truth.branches().size());
    EXPECT_EQ(bifurcations(found.tree).size(), bifurcations(truth).size());
    for (const glm::dvec3& place : bifurcations(found.tree)) {
      double nearest_mm = 1e9;
      for (const glm::dvec3& other : bifurcations(truth))
        nearest_mm = std::min(nearest_mm, glm::distance(place, other));
      // Centrelines meet within the parent's lumen.
      EXPECT_LT(nearest_mm, truth.nearest(place).radius_mm + 2 * voxel_mm) << place.x << ' ' << place.z;
    }
  }

  // Radii, away from forks and ends, where the cross-section is one vessel's.
  int count = 0, close = 0;
  for (const VesselBranch& branch : found.tree.branches())
    for (std::size_t i = 0; i < branch.points.size(); ++i) {
      const VesselTree::Location at = truth.nearest(branch.points[i].position_mm);
      const double from_ends_mm =
          std::min(branch.arc_length_mm[i], branch.arc_length_mm.back() - branch.arc_length_mm[i]);
      if (at.distance_mm > at.radius_mm || at.radius_mm < 2 * voxel_mm || from_ends_mm < 3 * at.radius_mm)
        continue;
      ++count;
      close += std::abs(branch.points[i].radius_mm - at.radius_mm) < 0.5 * voxel_mm;
    }
  ASSERT_GT(count, 500);
  // Half a voxel is what a mask can tell of a radius; noise of 40 HU takes a voxel off here and there.
  EXPECT_GT(static_cast<double>(close) / count, noise_hu ? 0.85 : 0.97);
}

INSTANTIATE_TEST_SUITE_P(AtNoise, ThoraxVessels,
                         testing::Values(std::pair(std::optional<double>(), 0.93),
                                         std::pair(std::optional(40.0), 0.88)),
                         [](const auto& noise) { return noise.param.first ? "Heavy" : "Mild"; });

class HeadVessels : public testing::TestWithParam<std::pair<std::optional<double>, double>> {};

TEST_P(HeadVessels, AreThePaintedOnes) {
  const auto [noise_hu, least_dice] = GetParam();
  const Result result = segmented("head", noise_hu, std::nullopt);
  EXPECT_GE(dice(result), least_dice);
  // Most arteries are a voxel thick here, between bones. At mild noise 32 branches are found, of true 32.
  const std::size_t branches = extract_centrelines(result.mask, "head").tree.branches().size();
  EXPECT_GE(branches, 28U);
  EXPECT_LE(branches, noise_hu ? 42U : 36U);
}

INSTANTIATE_TEST_SUITE_P(AtNoise, HeadVessels,
                         testing::Values(std::pair(std::optional<double>(), 0.93),
                                         std::pair(std::optional(40.0), 0.88)),
                         [](const auto& noise) { return noise.param.first ? "Heavy" : "Mild"; });

/// A scan of a thorax, small enough to be segmented in a second.
Volume small_thorax(ComputeDevice& device) {
  Progress progress;
  return generate(make_phantom("thorax", {.spacing_mm = 3.0}), device, progress);
}

TEST(Segmenting, TellsHowFarEachStepIs) {
  ComputeDevice device;
  std::vector<std::string> stages;
  std::map<std::string, int> moves;
  std::string wrong;
  Progress progress([&](const Progress::State& state) {
    if (stages.empty() || stages.back() != state.stage) stages.push_back(state.stage);
    ++moves[state.stage];
    if (state.done > state.total) wrong += state.stage + " ";
  });
  const Mask mask = segment_vessels(small_thorax(device), {}, "thorax", device, progress).mask;
  extract_centrelines(mask, "thorax", progress);
  EXPECT_EQ(wrong, "");
  EXPECT_EQ(stages,
            (std::vector<std::string>{"contrast", "thresholding", "removing bone", "separating chambers",
                                      "removing trabecular bone", "closing gaps", "selecting", "filling",
                                      "thinning", "centrelines"}));
  for (const char* stage :
       {"removing bone", "separating chambers", "removing trabecular bone", "thinning", "centrelines"})
    EXPECT_GE(moves[stage], 4) << stage;
}

TEST(Segmenting, StopsInAnyStep) {
  ComputeDevice device;
  const Volume volume = small_thorax(device);
  for (int steps = 0;; steps += 40) {
    int left = steps;
    Progress* running = nullptr;
    Progress progress([&](const Progress::State&) {
      if (left-- == 0) running->cancel();
    });
    running = &progress;
    try {
      extract_centrelines(segment_vessels(volume, {}, "thorax", device, progress).mask, "thorax", progress);
    } catch (const Cancelled&) {
      continue;
    }
    EXPECT_GE(steps, 200);  // some hundred steps, of which some were tried
    break;
  }
}

}  // namespace
}  // namespace xraycast::phantom_vessels_test
