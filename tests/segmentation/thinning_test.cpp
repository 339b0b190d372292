#include "xraycast/mask/thinning.hpp"

#include "support/tubes.hpp"
#include "xraycast/mask/components.hpp"

#include <gtest/gtest.h>

#include <random>

namespace xraycast::thinning_test {
namespace {

/// Vertices - edges + faces - cells of the union of the voxels' closed cubes, which takes voxels that share a
/// corner for connected, as thinning does.
std::int64_t euler_characteristic(const Mask& mask) {
  const Index3 size = mask.geometry.size;
  std::int64_t sum = 0;
  // Doubled coordinates: even ones are voxels' faces, odd ones their middles.
  for (std::int64_t z = 0; z <= 2 * size.z; ++z)
    for (std::int64_t y = 0; y <= 2 * size.y; ++y)
      for (std::int64_t x = 0; x <= 2 * size.x; ++x) {
        bool covered = false;
        for (std::int64_t k = 0; k < 8 && !covered; ++k)
          covered = mask.at({(x - (k & 1)) >> 1, (y - (k >> 1 & 1)) >> 1, (z - (k >> 2)) >> 1});
        if (covered) sum += (x + y + z) % 2 == 0 ? 1 : -1;
      }
  return sum;
}

Mask blob(unsigned seed) {
  std::mt19937 random(seed);
  Mask mask({.size = {14, 14, 14}});
  const double density = 0.2 + 0.06 * (seed % 10);
  for (std::uint8_t& voxel : mask.voxels)
    voxel = std::uniform_real_distribution<>()(random) < density ? 1 : 0;
  return mask;
}

TEST(Thinning, CountsTheEulerCharacteristicOfKnownShapes) {
  const VolumeGeometry grid{.size = {12, 12, 12}};
  const auto ball =
      mask_where(grid, [](const glm::dvec3& p) { return glm::distance(p, glm::dvec3(5.5)) < 5; });
  EXPECT_EQ(euler_characteristic(ball), 1);
  const auto shell = mask_where(grid, [](const glm::dvec3& p) {
    const double r = glm::distance(p, glm::dvec3(5.5));
    return r < 5 && r > 2;
  });
  EXPECT_EQ(euler_characteristic(shell), 2);
  const auto ring = mask_where(grid, [](const glm::dvec3& p) {
    const double r = glm::length(glm::dvec2(p) - 5.5);
    return r < 5 && r > 2 && p.z > 3 && p.z < 8;
  });
  EXPECT_EQ(euler_characteristic(ring), 0);
}

TEST(Thinning, KeepsTheEulerCharacteristicOf500RandomBlobs) {
  for (unsigned seed = 0; seed < 500; ++seed) {
    const Mask before = blob(seed);
    for (const StraightLines straight : {StraightLines::shrink, StraightLines::keep}) {
      const Mask after = thin(before, straight);
      ASSERT_EQ(euler_characteristic(after), euler_characteristic(before)) << "seed " << seed;
      ASSERT_EQ(Components(after).count(), Components(before).count()) << "seed " << seed;
      ASSERT_LT(after.count(), before.count()) << "seed " << seed;
    }
  }
}

TEST(Thinning, LeavesALineOfATube) {
  const auto tube = mask_where({.size = {40, 15, 15}}, [](const glm::dvec3& p) {
    return glm::length(glm::dvec2(p.y, p.z) - 7.0) < 5.2 && p.x > 2 && p.x < 37;
  });
  const Mask line = thin(tube);
  for (std::int64_t x = 10; x < 30; ++x) {
    int voxels = 0;
    for (std::int64_t z = 0; z < 15; ++z)
      for (std::int64_t y = 0; y < 15; ++y) voxels += line[{x, y, z}];
    EXPECT_EQ(voxels, 1) << "x " << x;
    EXPECT_EQ((line[{x, 7, 7}]), 1) << "x " << x;
  }
}

TEST(Thinning, LeavesLinesAndPointsAlone) {
  const auto cross = mask_where(
      {.size = {9, 9, 9}}, [](const glm::dvec3& p) { return (p.x == 4) + (p.y == 4) + (p.z == 4) >= 2; });
  EXPECT_EQ(thin(cross).voxels, cross.voxels);
}

// A core two voxels wide lies with its whole length on the border across it, and must not be deleted from one
// end to the other: tubes along an axis, with their middle on a voxel, between voxels, and elsewhere.
TEST(Thinning, KeepsTheLengthOfTubesAlongAnAxis) {
  for (const double middle : {0.0, 0.25, 0.5})
    for (const double radius : {2.5, 5.3, 12.3})
      for (int axis = 0; axis < 3; ++axis) {
        Index3 size(34);
        size[axis] = 90;
        const Mask tube = mask_where({.size = size}, [&](const glm::dvec3& p) {
          const double u = p[(axis + 1) % 3] - 16 - middle, v = p[(axis + 2) % 3] - 16 - middle;
          return u * u + v * v < radius * radius && p[axis] > 2 && p[axis] < 87;
        });
        // A flat cap shortens the line by up to the radius.
        EXPECT_GE(thin(tube, StraightLines::keep).count(), 84 - static_cast<std::int64_t>(2 * radius) - 2)
            << "middle " << middle << ", radius " << radius << ", axis " << axis;
      }
}

}  // namespace
}  // namespace xraycast::thinning_test
