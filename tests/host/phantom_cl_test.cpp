#include "xraycast/base/error.hpp"
#include "xraycast/phantom/phantom.hpp"
#include "xraycast/phantom/phantom_scene.hpp"

#include <glm/geometric.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <random>
#include <string>

namespace xraycast::phantom_cl_test {
namespace {

Volume paint(const Phantom& phantom) {
  ComputeDevice device;
  Progress progress;
  return generate(phantom, device, progress);
}

class PaintedPhantom : public testing::TestWithParam<std::string> {};
INSTANTIATE_TEST_SUITE_P(, PaintedPhantom, testing::ValuesIn(phantom_names()), [](const auto& name) {
  std::string identifier = name.param;
  std::ranges::replace(identifier, '-', '_');
  return identifier;
});

TEST_P(PaintedPhantom, HoldsTheTruthAtRandomVoxels) {
  // Sizes that no brick divides.
  const Phantom phantom =
      make_phantom(GetParam(), {.size = Index3(135, 121, 155), .noise_hu = 0.0, .table = true});
  const Volume volume = paint(phantom);
  const VolumeGeometry& g = phantom.geometry();
  std::mt19937 random(5);
  const auto draw = [&](std::int64_t n) {
    return static_cast<std::int64_t>(random() % static_cast<std::uint32_t>(n));
  };
  for (int i = 0; i < 30000; ++i) {
    const Index3 v(draw(g.size.x), draw(g.size.y), draw(g.size.z));
    const double truth = std::clamp(phantom.hu_at(g.to_world_mm(v)), -1024.0, 3071.0);
    // Half a unit of rounding. On a station of a loft, where two straight pieces meet, float may take the one
    // and double the other, and their slopes differ by a thousandth: 1 HU on an edge. Elsewhere float errs by
    // 0.05 HU.
    ASSERT_NEAR(volume.at(v.x, v.y, v.z), truth, 0.5 + 1) << v.x << ' ' << v.y << ' ' << v.z;
  }
}

// ---- moved bodies ---------------------------------------------------------------------------------

struct Held {
  std::string phantom;
  std::map<std::string, double> phase;
};

class PaintedMotion : public testing::TestWithParam<Held> {
 protected:
  PhantomOptions options(const std::map<std::string, double>& phase) const {
    return {.size = Index3(135, 121, 155),
            .noise_hu = 0.0,
            .table = true,
            .coronaries = GetParam().phantom == "thorax",
            .phase = phase};
  }
  const Phantom rest_ = make_phantom(GetParam().phantom, options({})),
                moved_ = make_phantom(GetParam().phantom, options(GetParam().phase));
  const VolumeGeometry& g_ = rest_.geometry();
};
INSTANTIATE_TEST_SUITE_P(, PaintedMotion,
                         testing::Values(Held{"thorax", {{"breath", 1}}}, Held{"thorax", {{"heart", 0.4}}},
                                         Held{"thorax", {{"breath", 0.6}, {"heart", 0.2}}},
                                         Held{"head", {{"turn", 1}}}));

TEST_P(PaintedMotion, HoldsTheTruthAtRandomVoxels) {
  const Volume volume = paint(moved_);
  std::mt19937 random(7);
  const auto draw = [&](std::int64_t n) {
    return static_cast<std::int64_t>(random() % static_cast<std::uint32_t>(n));
  };
  for (int i = 0; i < 30000; ++i) {
    const Index3 v(draw(g_.size.x), draw(g_.size.y), draw(g_.size.z));
    const double truth = std::clamp(moved_.hu_at(g_.to_world_mm(v)), -1024.0, 3071.0);
    // As at rest.
    ASSERT_NEAR(volume.at(v.x, v.y, v.z), truth, 0.5 + 1) << v.x << ' ' << v.y << ' ' << v.z;
  }
}

TEST_P(PaintedMotion, IsTheRestSeenThroughItsPullBack) {
  const Volume rest = paint(rest_), volume = paint(moved_);
  std::int64_t flat = 0, changed = 0, unlike = 0;
  for (std::int64_t z = 0; z < g_.size.z; z += 2)
    for (std::int64_t y = 0; y < g_.size.y; y += 2)
      for (std::int64_t x = 0; x < g_.size.x; x += 2) {
        const glm::dvec3 index = g_.to_index(moved_.motion().pulled_back_mm(g_.to_world_mm({x, y, z})));
        const Index3 first(glm::floor(index));
        if (glm::any(glm::lessThan(first, Index3(0))) ||
            glm::any(glm::greaterThan(first + Index3(1), g_.size - Index3(1))))
          continue;
        std::int16_t low = 32767, high = -32768;
        for (int corner = 0; corner < 8; ++corner) {
          const std::int16_t hu =
              rest.at(first.x + (corner & 1), first.y + (corner >> 1 & 1), first.z + (corner >> 2));
          low = std::min(low, hu);
          high = std::max(high, hu);
        }
        // Away from edges: all eight voxels around the place are alike.
        if (high > low + 1) continue;
        ++flat;
        changed += std::abs(volume.at(x, y, z) - rest.at(x, y, z)) > 50;
        unlike += std::abs(volume.at(x, y, z) - low) > 1;
      }
  // What is thinner than these voxels may lie between all eight: the finest vessels, twigs of the lungs, and
  // walls of bones.
  EXPECT_LT(unlike, flat / 1000);
  EXPECT_GT(flat, 150000);
  EXPECT_GT(changed, 100);
}

TEST_P(PaintedMotion, MasksItsMovedVessels) {
  const Volume volume = paint(moved_);
  const std::vector<std::uint8_t> mask = vessel_mask(moved_), resting = vessel_mask(rest_);
  std::int64_t marked = 0, elsewhere = 0;
  for (std::size_t i = 0; i < mask.size(); ++i) {
    ASSERT_LE(mask[i], 1);
    if (!mask[i]) continue;
    ++marked;
    elsewhere += resting[i] == 0;
    // As at rest.
    ASSERT_GE(volume.hu()[i], (350 - 1000) / 2 - 1);
  }
  EXPECT_GT(marked, 1000);
  EXPECT_GT(elsewhere, 10);
  // A voxel is in or out as its place at rest is; those of the tree's points are in.
  for (const VesselBranch& branch : moved_.vessel_branches())
    for (const VesselPoint& point : branch.points) {
      const Index3 v(glm::round(g_.to_index(point.position_mm)));
      // Half a voxel's diagonal is 3.1 mm, and a vessel may be flattened by a third.
      if (point.radius_mm < 4.7 || glm::any(glm::lessThan(v, Index3(0))) ||
          glm::any(glm::greaterThanEqual(v, g_.size)))
        continue;
      EXPECT_EQ(mask[static_cast<std::size_t>((v.z * g_.size.y + v.y) * g_.size.x + v.x)], 1);
    }
}

TEST(PaintedBall, MovesVolumesByItsDeterminant) {
  // A ball of 40 mm under x -> A x with det A = 1.25 * 0.9 and a shear.
  PhantomMode squeeze{.name = "squeeze", .share = [](double phase) { return phase; }};
  squeeze.displacement_mm = [](const glm::dvec3& x) { return glm::dvec3(0.25 * x.x, 0.6 * x.x, -0.1 * x.z); };
  const auto ball = std::make_shared<PhantomScene>(-1000);
  ball->paint(1000);
  ball->ellipsoid({0, 0, 0}, {40, 40, 40});
  const VolumeGeometry grid{{101, 99, 103}, {1, 1, 1}, {-50, -49, -51}};
  const Volume volume = paint({"ball", grid, ball, {}, {}, 0, 0, {squeeze}, PhantomMotion({squeeze}, {1})});
  double sum_mm3 = 0;
  for (const std::int16_t hu : volume.hu()) sum_mm3 += (hu + 1000) / 2000.0;
  // The faded edge is a first order's one: within a thousandth of a ball of 40 voxels.
  EXPECT_NEAR(sum_mm3, 4.0 / 3 * 3.14159265 * 40 * 40 * 40 / (1.25 * 0.9), 0.002 * 238000);
}

TEST(PaintedThorax, IsAtPhaseZeroTheRestBitForBit) {
  const PhantomOptions options{.size = Index3(70, 60, 50)};
  PhantomOptions held = options;
  held.phase = {{"breath", 0}, {"heart", 0}};
  EXPECT_TRUE(std::ranges::equal(paint(make_phantom("thorax", options)).hu(),
                                 paint(make_phantom("thorax", held)).hu()));
}

TEST(PaintedThorax, IsTheSameEveryTimeAndForEverySeedItsOwn) {
  const PhantomOptions options{.size = Index3(70, 60, 50)};
  const Volume once = paint(make_phantom("thorax", options)), again = paint(make_phantom("thorax", options));
  EXPECT_TRUE(std::ranges::equal(once.hu(), again.hu()));
  PhantomOptions other = options;
  other.seed = 2;
  const Volume reseeded = paint(make_phantom("thorax", other));
  EXPECT_FALSE(std::ranges::equal(once.hu(), reseeded.hu()));
}

TEST(PaintedThorax, ArrivesInRunsOfAnyLength) {
  const Phantom thorax = make_phantom("thorax", {.size = Index3(70, 60, 50)});
  const Volume whole = paint(thorax);
  ComputeDevice device;
  Progress progress;
  PhantomSource source(thorax, device);
  std::vector<std::int16_t> run(static_cast<std::size_t>(7 * whole.geometry().slice_voxels()));
  std::int64_t next = 0;
  for (std::int64_t count; (count = source.read(run, progress)) > 0; next += count)
    EXPECT_TRUE(std::ranges::equal(whole.slices(next, count), std::span(run).first(static_cast<std::size_t>(
                                                                  count * whole.geometry().slice_voxels()))));
  EXPECT_EQ(next, 50);
  const auto [low, high] = std::ranges::minmax_element(whole.hu());
  EXPECT_EQ(source.hu_range().lowest, *low);
  EXPECT_EQ(source.hu_range().highest, *high);
}

TEST(PaintedThorax, StopsWhenCancelled) {
  const Phantom thorax = make_phantom("thorax", {.size = Index3(70, 60, 50)});
  ComputeDevice device;
  Progress progress;
  progress.cancel();
  EXPECT_THROW(generate(thorax, device, progress), Cancelled);
}

TEST(PhantomNoise, HasItsDeviationAndNoMean) {
  const Phantom sphere = make_phantom("sphere", {.size = Index3(64, 64, 64), .noise_hu = 20.0});
  const Volume volume = paint(sphere);
  double sum = 0, squares = 0;
  std::int64_t count = 0;
  for (std::int64_t z = 22; z < 42; ++z)
    for (std::int64_t y = 22; y < 42; ++y)
      for (std::int64_t x = 22; x < 42; ++x, ++count) {
        const double hu = volume.at(x, y, z);  // water: 0
        sum += hu;
        squares += hu * hu;
      }
  const double n = static_cast<double>(count);
  // Five standard errors: 20 / sqrt(n) for the mean, about 20 / sqrt(2 n) for the deviation.
  EXPECT_NEAR(sum / n, 0, 5 * 20 / std::sqrt(n));
  EXPECT_NEAR(std::sqrt(squares / n), 20, 5 * 20 / std::sqrt(2 * n));
}

class VesselMask : public testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(, VesselMask, testing::Values("thorax", "head"));

TEST_P(VesselMask, AgreesWithVoxelsAndCentrelines) {
  const Phantom phantom = make_phantom(GetParam(), {.spacing_mm = 1.5, .noise_hu = 0.0});
  const Volume volume = paint(phantom);
  const VolumeGeometry& g = phantom.geometry();
  const std::vector<std::uint8_t> mask = vessel_mask(phantom);
  ASSERT_EQ(mask.size(), volume.hu().size());
  std::int64_t marked = 0;
  for (std::size_t i = 0; i < mask.size(); ++i) {
    if (!mask[i]) continue;
    ++marked;
    // A marked voxel's centre is inside, so contrast fills half of it or more, whatever (air, at worst) is
    // around; 1 HU for a place on the very surface, in float.
    ASSERT_GE(volume.hu()[i], (350 - 1000) / 2 - 1);
  }
  // The sum of frustums counts the forks' overlaps twice and leaves the ends' caps out: a tenth covers both.
  double tubes_mm3 = 0;
  for (const VesselBranch& branch : phantom.vessel_branches())
    for (std::size_t i = 1; i < branch.points.size(); ++i) {
      const VesselPoint &a = branch.points[i - 1], &b = branch.points[i];
      if (std::abs(a.position_mm.z) > g.upper_mm().z) continue;  // the roots of the head's vessels
      tubes_mm3 += 3.14159 / 3 * glm::distance(a.position_mm, b.position_mm) *
                   (a.radius_mm * a.radius_mm + a.radius_mm * b.radius_mm + b.radius_mm * b.radius_mm);
    }
  EXPECT_NEAR(static_cast<double>(marked) * g.spacing_mm.x * g.spacing_mm.y * g.spacing_mm.z, tubes_mm3,
              0.1 * tubes_mm3);
  for (const VesselBranch& branch : phantom.vessel_branches())
    for (const VesselPoint& point : branch.points) {
      const Index3 v(glm::round(g.to_index(point.position_mm)));
      // The nearest voxel's centre is at most half a diagonal away, 1.3 mm.
      if (point.radius_mm < 1.3 || glm::any(glm::lessThan(v, Index3(0))) ||
          glm::any(glm::greaterThanEqual(v, g.size)))
        continue;
      EXPECT_EQ(mask[static_cast<std::size_t>((v.z * g.size.y + v.y) * g.size.x + v.x)], 1);
    }
}

TEST(AbdomenParts, AreWhereTheirVoxelsAre) {
  const Phantom phantom = make_phantom("abdomen", {.spacing_mm = 2.0, .noise_hu = 0.0});
  const Volume volume = paint(phantom);
  ComputeDevice device;
  Progress progress;
  const std::map<std::string, double> hu{{"aorta", 150},         {"portal", 165}, {"cava", 165},
                                         {"hepatic-veins", 165}, {"liver", 115},  {"kidneys", 180},
                                         {"spleen", 125}};
  std::vector<std::uint8_t> seen(volume.hu().size());
  for (const PhantomPart& part : phantom.parts()) {
    const std::vector<std::uint8_t> mask = part_mask(phantom, part.name, device, progress);
    std::vector<std::int16_t> inside;
    for (std::size_t i = 0; i < mask.size(); ++i) {
      if (mask[i] == 0) continue;
      inside.push_back(volume.hu()[i]);
      // Two parts fill half of a voxel each, or nearly: a voxel of both is one in a thousand of their rims.
      seen[i] += mask[i];
    }
    ASSERT_GT(inside.size(), 1000U) << part.name;
    if (!hu.contains(part.name)) continue;
    const auto middle = inside.begin() + static_cast<std::ptrdiff_t>(inside.size() / 2);
    std::ranges::nth_element(inside, middle);
    // Rounding; vessels as thin as a voxel are a few per cent of their system.
    EXPECT_NEAR(*middle, hu.at(part.name), 1) << part.name;
  }
  EXPECT_LT(std::ranges::count_if(seen, [](std::uint8_t n) { return n > 1; }), 100);
}

}  // namespace
}  // namespace xraycast::phantom_cl_test
