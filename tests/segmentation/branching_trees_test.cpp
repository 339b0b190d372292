// Trees of arteries by a seed, as surfaces and as masks, come back as themselves: XRAYCAST_RUNS of them, by
// default 20.
#include "support/branching_tree.hpp"
#include "support/temporary_folder.hpp"
#include "support/tree_comparison.hpp"
#include "xraycast/given_vessels/given_vessels.hpp"
#include "xraycast/image_file/write_volume.hpp"

#include <glm/common.hpp>
#include <gtest/gtest.h>

#include <cstdlib>
#include <iostream>
#include <stdexcept>

namespace xraycast::branching_trees_test {
namespace {

constexpr double kLeastWhole = 0.95;

std::uint32_t trees() {
  const char* wanted = std::getenv("XRAYCAST_RUNS");
  const int trees = wanted ? std::atoi(wanted) : 20;
  if (trees < 1) throw std::invalid_argument("XRAYCAST_RUNS: must be 1 or more");
  return static_cast<std::uint32_t>(trees);
}

Vessels vessels_of(const std::filesystem::path& input, const VesselTree& truth) {
  GivenVesselsRequest request;
  request.input = input;
  request.options.root_mm =
      truth.branches()[static_cast<std::size_t>(truth.root())].points.front().position_mm;
  request.options.voxels = 8'000'000;  // a vessel of 1.2 mm has three across
  Progress unheard;
  return given_vessels(request, nullptr, unheard);
}

/// Its voxels of 0.4 mm whose centres lie in the lumen.
void write_lumen(const VesselTree& tree, const std::filesystem::path& path) {
  glm::dvec3 low_mm(1e9), high_mm(-1e9);
  for (const VesselBranch& branch : tree.branches())
    for (const VesselPoint& point : branch.points) {
      low_mm = glm::min(low_mm, point.position_mm - point.radius_mm - 2.0);
      high_mm = glm::max(high_mm, point.position_mm + point.radius_mm + 2.0);
    }
  constexpr double kVoxel_mm = 0.4;
  const VolumeGeometry grid{Index3((high_mm - low_mm) / kVoxel_mm), glm::dvec3(kVoxel_mm), low_mm};
  std::vector<std::uint8_t> voxels(static_cast<std::size_t>(grid.voxel_count()));
  parallel_for(grid.size.z, [&](std::int64_t z) {
    auto* voxel = voxels.data() + z * grid.size.x * grid.size.y;
    for (std::int64_t y = 0; y < grid.size.y; ++y)
      for (std::int64_t x = 0; x < grid.size.x; ++x)
        *voxel++ = tree.inside(grid.to_world_mm({x, y, z})) ? 1 : 0;
  });
  write_mask(grid, voxels, path);
}

struct Score {
  int whole = 0, straight = 0, wide = 0, all = 0;
};

Score score(const std::function<void(const VesselTree&, const std::filesystem::path&)>& write,
            const char* file) {
  const TemporaryFolder folder;
  Score score;
  for (std::uint32_t seed = 0; seed < trees(); ++seed) {
    const VesselTree truth = branching_tree(seed);
    write(truth, folder / file);
    const Vessels found = vessels_of(folder / file, truth);
    const TreeDifference of = tree_difference(truth, found.centrelines.tree);
    const bool is_straight = of.off_95_mm < 0.3, is_wide = of.radius_95 < 0.05;
    score.whole += of.is_whole, score.straight += is_straight, score.wide += is_wide;
    score.all += of.is_whole && is_straight && is_wide;
    if (!of.is_whole || !is_straight || !is_wide)
      std::cout << seed << ": " << found.centrelines.tree.branches().size() << " of "
                << truth.branches().size() << (of.is_whole ? "" : ", not whole") << ", " << of.off_95_mm
                << " mm off, radii " << of.radius_95 << std::endl;
  }
  std::cout << file << ": whole " << score.whole << ", lines " << score.straight << ", radii " << score.wide
            << ", all " << score.all << std::endl;
  return score;
}

TEST(BranchingTrees, ComeBackFromTheirSurfaces) {
  const Score found =
      score([](const VesselTree& tree, const auto& path) { write_mesh(tube_mesh(tree), path); }, "tree.stl");
  EXPECT_GE(found.all, kLeastWhole * trees());
}

TEST(BranchingTrees, ComeBackFromTheirMasks) {
  const Score found = score(write_lumen, "tree.nrrd");
  EXPECT_GE(found.whole, kLeastWhole * trees());
}

}  // namespace
}  // namespace xraycast::branching_trees_test
