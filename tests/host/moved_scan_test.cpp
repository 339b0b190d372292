#include "xraycast/motion/moved_scan.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/progress.hpp"

#include <glm/geometric.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace xraycast::moved_scan_test {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

/// Tissue of noise within air.
std::shared_ptr<const Volume> scan() {
  auto volume = std::make_shared<Volume>(VolumeGeometry{{30, 28, 26}, {2, 2.5, 3}, {-29, -34, 10}});
  std::mt19937 random(7);
  std::ranges::fill(volume->hu(), std::int16_t{-1000});
  for (std::int64_t z = 0; z < 26; ++z)
    for (std::int64_t y = 4; y < 24; ++y)
      for (std::int64_t x = 4; x < 26; ++x)
        volume->at(x, y, z) = static_cast<std::int16_t>(random() % 400) - 200;
  return volume;
}

HeldMotion held(std::shared_ptr<const Displacement> moves) { return HeldMotion({{{1, std::move(moves)}}}); }

HeldMotion shift(const glm::dvec3& by_mm) { return held(affine_displacement(glm::dmat3(1), by_mm)); }

Volume moved_volume(const HeldMotion& motion) {
  Progress progress;
  return collect(*moved_slices(scan(), motion), progress);
}

/// The same sum in double precision, written in another way.
double trilinear(const Volume& volume, const glm::dvec3& index) {
  double sum = 0;
  for (int corner = 0; corner < 8; ++corner) {
    double weight = 1;
    Index3 voxel;
    for (int axis = 0; axis < 3; ++axis) {
      const double at =
          std::min(std::max(index[axis], 0.0), static_cast<double>(volume.geometry().size[axis] - 1));
      const double share = at - std::floor(at);
      voxel[axis] = static_cast<std::int64_t>(std::floor(at)) + (corner >> axis & 1);
      weight *= corner >> axis & 1 ? share : 1 - share;
    }
    if (weight > 0) sum += weight * volume.at(voxel.x, voxel.y, voxel.z);
  }
  return sum;
}

TEST(MovedScan, OfAWholeVoxelIsThatVoxel) {
  const auto still = scan();
  const Volume moved = moved_volume(shift({2, -2.5, 6}));
  EXPECT_EQ(moved.geometry(), still->geometry());
  for (std::int64_t z = 0; z < 24; ++z)
    for (std::int64_t y = 1; y < 28; ++y)
      for (std::int64_t x = 0; x < 29; ++x) ASSERT_EQ(moved.at(x, y, z), still->at(x + 1, y - 1, z + 2));
  // What lies beyond the scan is air.
  EXPECT_EQ(moved.at(10, 10, 24), kPaddingHu);
  EXPECT_EQ(moved.at(29, 10, 10), kPaddingHu);
}

TEST(MovedScan, IsTrilinearInHu) {
  const auto still = scan();
  const HeldMotion motion =
      held(affine_displacement({{0.95, 0.04, 0}, {-0.03, 1.02, 0.05}, {0, 0.02, 0.9}}, {1, 2, 3}));
  const Volume moved = moved_volume(motion);
  const VolumeGeometry& grid = still->geometry();
  std::int64_t inside = 0;
  for (std::int64_t z = 0; z < grid.size.z; ++z)
    for (std::int64_t y = 0; y < grid.size.y; ++y)
      for (std::int64_t x = 0; x < grid.size.x; ++x) {
        const glm::dvec3 x_mm = grid.to_world_mm({x, y, z});
        const glm::dvec3 index = grid.to_index(x_mm + motion.displacement_mm(x_mm));
        const bool is_inside = glm::all(glm::greaterThan(index, glm::dvec3(-0.5))) &&
                               glm::all(glm::lessThan(index, glm::dvec3(grid.size) - 0.5));
        inside += is_inside ? 1 : 0;
        // Rounding to whole HU.
        ASSERT_NEAR(moved.at(x, y, z), is_inside ? trilinear(*still, index) : kPaddingHu, 0.5 + 1e-6);
      }
  EXPECT_GT(inside, grid.voxel_count() / 2);
}

TEST(MovedScan, ComesInAnyPortions) {
  const HeldMotion motion = shift({1, 1, 1});
  const Volume whole = moved_volume(motion);
  const auto source = moved_slices(scan(), motion);
  Progress progress;
  std::vector<std::int16_t> slices(3 * 30 * 28);
  std::int64_t done = 0;
  while (const std::int64_t count = source->read(slices, progress)) {
    ASSERT_TRUE(std::ranges::equal(whole.slices(done, count),
                                   std::span(slices).first(static_cast<std::size_t>(count) * 30 * 28)));
    done += count;
  }
  EXPECT_EQ(done, 26);
}

TEST(MovedScan, ThatIsStillIsTheScanItself) {
  const auto still = scan();
  Progress progress;
  Scan opened{{}, std::make_unique<VolumeSource>(*still)};
  const SliceSource* source = opened.source.get();
  EXPECT_EQ(moved(std::move(opened), {}, "m.json", progress).source.get(), source);
}

// ---- displacements that do not fit ---------------------------------------------------------------------

/// Of 5 x 5 x 5 nodes from a corner to another.
HeldMotion field_between(const glm::dvec3& lower_mm, const glm::dvec3& upper_mm, const glm::vec3& d_mm) {
  const glm::dvec3 step = (upper_mm - lower_mm) / 4.0;
  const FieldGrid grid{{5, 5, 5}, lower_mm, {{step.x, 0, 0}, {0, step.y, 0}, {0, 0, step.z}}};
  return held(field_of({grid, std::vector<glm::vec3>(125, d_mm)}, "f"));
}

std::string refusal(const HeldMotion& motion) {
  try {
    check_motion(*scan(), motion, "m.json");
    return "";
  } catch (const InputError& error) {
    return error.what();
  }
}

TEST(MovedScan, RefusesFieldsOfAnotherFrame) {
  EXPECT_THAT(
      refusal(field_between({500, 500, 500}, {600, 600, 600}, {1, 0, 0})),
      HasSubstr("m.json: its displacements lie elsewhere than the body, which is within -30 to 30, "));
}

TEST(MovedScan, RefusesFieldsThatEndWithinTheBodyWhereItMoves) {
  EXPECT_THAT(refusal(field_between({-60, -60, -10}, {60, 60, 50}, {0, 0, 8})),
              HasSubstr("end within the body, at "));
  EXPECT_THAT(refusal(field_between({-60, -60, -10}, {60, 60, 50}, {0, 0, 8})),
              HasSubstr("they still are 8.0 mm long"));
  // Where the field has come to rest, it may end.
  EXPECT_EQ(refusal(field_between({-60, -60, -10}, {60, 60, 50}, {0, 0, 0.5})), "");
  EXPECT_EQ(refusal(field_between({-60, -60, -10}, {60, 60, 120}, {0, 0, 8})), "");
}

TEST(MovedScan, TakesAFieldOfAPartThatRestsAtItsBorderWithOneOfTheWholeBody) {
  VectorImage heart{{{5, 5, 5}, {-10, -10, 40}, glm::dmat3(5)}, std::vector<glm::vec3>(125, {0, 0, 0})};
  heart.vectors[62] = {0, 0, 6};  // in the middle
  const HeldMotion both({{{1, affine_displacement(glm::dmat3(1), {0, 0, 9})}}, {{1, field_of(heart, "f")}}});
  EXPECT_EQ(refusal(both), "");
}

TEST(MovedScan, HintsAtTheSignWhereBodyComesFromBeyondTheScan) {
  // The tissue reaches both ends of 78 mm along z: 15 mm of it are beyond.
  EXPECT_THAT(
      check_motion(*scan(), shift({0, 0, -15}), "m.json"),
      ::testing::ElementsAre(HasSubstr("of the body show what lies beyond the scan, which is air; if that "
                                       "is not meant, check the sign of m.json")));
  EXPECT_THAT(check_motion(*scan(), shift({0, 0, 0.5}), "m.json"), IsEmpty());
}

}  // namespace
}  // namespace xraycast::moved_scan_test
