// Every step of a segmentation on a scene whose answer is known.
#include "support/tubes.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/mask/components.hpp"
#include "xraycast/mask/distance_transform.hpp"
#include "xraycast/segmentation/body_mask.hpp"
#include "xraycast/segmentation/contrast.hpp"
#include "xraycast/segmentation/gap_closing.hpp"
#include "xraycast/segmentation/lumen_completion.hpp"
#include "xraycast/segmentation/segment.hpp"
#include "xraycast/segmentation/surface.hpp"
#include "xraycast/segmentation/threshold.hpp"
#include "xraycast/segmentation/trabecular_bone.hpp"
#include "xraycast/segmentation/vessel_selection.hpp"
#include "xraycast/segmentation/watershed.hpp"

#include <glm/geometric.hpp>
#include <glm/vector_relational.hpp>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numbers>
#include <random>

namespace xraycast::segment_steps_test {
namespace {

class DistanceTransform : public testing::TestWithParam<double> {};

TEST_P(DistanceTransform, EqualsTheBruteForceOneOnAnisotropicVoxels) {
  std::mt19937 random(1);
  std::bernoulli_distribution is_inside(GetParam());
  const VolumeGeometry grid{.size = {9, 11, 7}, .spacing_mm = {0.7, 1.1, 2}};
  Mask mask(grid);
  for (std::uint8_t& voxel : mask.voxels) voxel = is_inside(random);
  const std::vector<float> distance_mm = distance_to_background_mm(mask);
  for (std::size_t i = 0; i < mask.voxels.size(); ++i) {
    const auto at = [&](std::size_t k) {
      const auto o = static_cast<std::int64_t>(k);
      return grid.to_world_mm({o % 9, o / 9 % 11, o / 99});
    };
    double nearest_mm = 1e9;
    for (std::size_t k = 0; k < mask.voxels.size(); ++k)
      if (mask.voxels[k] == 0) nearest_mm = std::min(nearest_mm, glm::distance(at(i), at(k)));
    // Distances are computed in double precision and stored as float.
    ASSERT_NEAR(distance_mm[i], nearest_mm, 1e-5);
  }
}

// Mostly inside, and with whole lines of voxels outside.
INSTANTIATE_TEST_SUITE_P(OfFilling, DistanceTransform, testing::Values(0.875, 0.05));

TEST(Components, TouchByCorners) {
  Mask mask({.size = {4, 4, 4}});
  mask[{0, 0, 0}] = mask[{1, 1, 1}] = mask[{3, 3, 3}] = 1;
  const Components parts(mask);
  EXPECT_EQ(parts.count(), 2);
  EXPECT_EQ(parts.at({0, 0, 0}), parts.at({1, 1, 1}));
  EXPECT_EQ(parts.at({2, 2, 2}), -1);
  EXPECT_EQ(parts.voxels(parts.largest()), 2);
}

/// Air around a body of soft tissue with a vessel of 400 HU, and noise of 10 HU.
Volume angiography() {
  Volume volume({.size = {60, 60, 40}});
  std::mt19937 random(2);
  std::normal_distribution<double> noise(0, 10);
  for (std::int64_t z = 0; z < 40; ++z)
    for (std::int64_t y = 0; y < 60; ++y)
      for (std::int64_t x = 0; x < 60; ++x) {
        const double from_axis = std::hypot(static_cast<double>(x) - 30, static_cast<double>(y) - 30);
        const double hu = from_axis < 7 ? 400 : from_axis < 27 ? 50 : -1000;
        volume.at(x, y, z) = static_cast<std::int16_t>(std::lround(hu + noise(random)));
      }
  return volume;
}

TEST(Contrast, IsReadFromTheHistogram) {
  const Contrast contrast = measure_contrast(angiography(), "scan");
  // A peak of 10 HU width, looked for with windows of 10 and 15 HU.
  EXPECT_NEAR(contrast.tissue_hu, 50, 10);
  EXPECT_NEAR(contrast.vessel_hu, 400, 10);
  // The median of whole numbers.
  EXPECT_NEAR(contrast.noise_hu, 10, 1);
}

class CutOffNoise : public testing::TestWithParam<double> {};

TEST_P(CutOffNoise, IsMeasuredAsIfItWereNot) {
  constexpr double kNoise_hu = 40;
  Volume volume({.size = {80, 60, 60}});
  std::ranges::fill(volume.hu(), 0);
  std::mt19937 random(3);
  std::normal_distribution<double> noise(GetParam() * kNoise_hu, kNoise_hu);
  for (std::int64_t z = 0; z < 60; ++z)
    for (std::int64_t y = 0; y < 60; ++y)
      for (std::int64_t x = 0; x < 60; ++x)  // and padding beside it
        volume.at(x, y, z) = static_cast<std::int16_t>(std::lround(std::max(noise(random), 0.0)));
  // What is left of a normal distribution is none: cut off in its middle, the median of second differences
  // lies 4 % below that of normal ones with the same standard deviation. Half a step of a median of whole
  // numbers is 1 %, and 27,000 of them have a standard error of 0.8 %.
  EXPECT_NEAR(measure_noise_hu(volume), kNoise_hu, 0.06 * kNoise_hu);
}

// How far above the cut the background lies, in standard deviations.
INSTANTIATE_TEST_SUITE_P(OfBackground, CutOffNoise, testing::Values(0, 0.5, 1, 2, 5));

TEST(Contrast, IsMissingInANativeScan) {
  Volume volume = angiography();
  for (std::int16_t& hu : volume.hu()) hu = std::min<std::int16_t>(hu, 90);
  EXPECT_THROW(measure_contrast(volume, "scan"), InputError);
}

TEST(Threshold, FindsTheVesselAndItsRim) {
  const Volume volume = angiography();
  const Mask mask = threshold(volume, window_of(measure_contrast(volume, "scan")));
  const Mask truth =
      mask_where(volume.geometry(), [](const glm::dvec3& p) { return std::hypot(p.x - 30, p.y - 30) < 7; });
  EXPECT_EQ(mask.voxels, truth.voxels);
}

/// A scan of 24 voxels along each axis, whose lumen of 300 HU in tissue of 50 HU is where `is_lumen` says.
Volume blurred(const std::function<bool(const glm::dvec3&)>& is_lumen) {
  constexpr int kSize = 24, kParts = 8;  // parts of a voxel along an axis
  Volume volume({.size = Index3(kSize)});
  for (std::int64_t i = 0; i < volume.geometry().voxel_count(); ++i) {
    const glm::dvec3 centre(voxel_at(volume.geometry(), i));
    int filled = 0;
    for (int part = 0; part < kParts * kParts * kParts; ++part)
      filled += is_lumen(
          centre + (glm::dvec3(part % kParts, part / kParts % kParts, part / (kParts * kParts)) + 0.5) / 8.0 -
          0.5);
    volume.hu()[static_cast<std::size_t>(i)] = static_cast<std::int16_t>(50 + 250 * filled / 512);
  }
  return volume;
}

class HalfFilledRim : public testing::TestWithParam<glm::dvec3> {};

TEST_P(HalfFilledRim, IsFoundAroundAVesselOfWhichOneVoxelAcrossIsKnown) {
  const glm::dvec3 along = glm::normalize(GetParam()), middle(12, 12, 12);
  const auto off = [&](const glm::dvec3& p) { return glm::length(glm::cross(p - middle, along)); };
  const Volume scan = blurred([&](const glm::dvec3& p) { return off(p) < 1.1; });
  Mask vessel = mask_where(scan.geometry(), [&](const glm::dvec3& p) { return off(p) < 0.4; });
  add_half_filled_rim(scan, Mask(scan.geometry()), vessel);
  std::int64_t missing = 0, more = 0, all = 0;
  for (std::int64_t i = 0; i < scan.geometry().voxel_count(); ++i) {
    const Index3 here = voxel_at(scan.geometry(), i);
    if (glm::any(glm::lessThan(here, Index3(3))) || glm::any(glm::greaterThan(here, Index3(20)))) continue;
    const bool is_filled = scan.hu()[static_cast<std::size_t>(i)] > 180;  // 175 is half
    all += is_filled;
    missing += is_filled && vessel[here] == 0;
    more += !is_filled && vessel[here] != 0;
  }
  EXPECT_GT(all, 80);
  EXPECT_EQ(missing, 0);
  EXPECT_EQ(more, 0);
}

INSTANTIATE_TEST_SUITE_P(Along, HalfFilledRim,
                         testing::Values(glm::dvec3(1, 0, 0), glm::dvec3(0, 0, 1), glm::dvec3(1, 1, 0),
                                         glm::dvec3(0, 1, -1), glm::dvec3(1, 1, 1)));

TEST(HalfFilledRim, DoesNotGrowAlongASeriesOfBrightVoxels) {
  const auto is_stick = [](const glm::dvec3& p) {
    return std::abs(p.x - 12) < 0.5 && std::abs(p.y - 12) < 0.5 && p.z < 18;
  };
  const Volume scan = blurred([&](const glm::dvec3& p) { return p.z < 11.5 || is_stick(p); });
  Mask lumen = mask_where(scan.geometry(), [](const glm::dvec3& p) { return p.z < 11.5; });
  const std::int64_t before = lumen.count();
  add_half_filled_rim(scan, Mask(scan.geometry()), lumen);
  EXPECT_EQ(lumen.count(), before + 1);
}

TEST(Body, IsTrunkAndArmsWithTheirLungsButNoTable) {
  Volume volume({.size = {100, 60, 4}, .spacing_mm = {4, 4, 4}});
  const auto within = [](double x, double y, double at_x, double at_y, double a, double b) {
    return std::hypot((x - at_x) / a, (y - at_y) / b) < 1;
  };
  for (std::int64_t i = 0; i < volume.geometry().voxel_count(); ++i) {
    const auto x = static_cast<double>(i % 100), y = static_cast<double>(i / 100 % 60);
    const bool is_trunk = within(x, y, 65, 20, 40, 16), is_lung = within(x, y, 90, 20, 20, 5),
               is_arm = within(x, y, 12, 20, 6, 6), is_table = y >= 44 && y < 46,
               is_rail = within(x, y, 30, 52, 1, 3);
    volume.hu()[static_cast<std::size_t>(i)] =
        static_cast<std::int16_t>(is_table || is_rail                ? 300
                                  : (is_trunk && !is_lung) || is_arm ? 40
                                                                     : -1000);
  }
  const Mask body = find_body_mask(volume);
  EXPECT_TRUE(body.at({60, 20, 2}));   // trunk
  EXPECT_TRUE(body.at({90, 20, 2}));   // a lung
  EXPECT_TRUE(body.at({99, 20, 2}));   // where the scan's border cuts it
  EXPECT_TRUE(body.at({12, 20, 2}));   // an arm
  EXPECT_FALSE(body.at({22, 20, 2}));  // beside it
  EXPECT_FALSE(body.at({60, 45, 2}));  // the table
  EXPECT_FALSE(body.at({30, 52, 2}));  // a rail
}

TEST(Body, IsEverythingWhereNothingIsThick) {
  Volume volume({.size = {40, 40, 4}});
  std::ranges::fill(volume.hu(), std::int16_t{-1000});
  volume.at(20, 20, 2) = 400;
  EXPECT_EQ(find_body_mask(volume).count(), volume.geometry().voxel_count());
}

TEST(Watershed, PartsAVesselFromTheChamberThatItLeaves) {
  const VolumeGeometry grid{.size = {60, 60, 100}};
  const auto chamber = [](const glm::dvec3& p) { return glm::distance(p, glm::dvec3(30, 30, 30)) < 22; };
  const auto vessel = [](const glm::dvec3& p) {
    return std::hypot(p.x - 30, p.y - 30) < (std::abs(p.z - 54) < 3 ? 6 : 9) && p.z > 50;
  };
  Mask mask = mask_where(grid, [&](const glm::dvec3& p) { return chamber(p) || vessel(p); });
  separate_chambers(mask, {}, "mask");
  EXPECT_FALSE(mask.at({30, 30, 30}));
  EXPECT_TRUE(mask.at({30, 30, 80}));
  EXPECT_EQ(Components(mask).largest(), Components(mask).at({30, 30, 80}));
}

/// Two chambers with a wide passage between them, and an aorta that leaves the larger one at its valve.
Mask heart_and_aorta() {
  return mask_where({.size = {64, 60, 120}}, [](const glm::dvec3& p) {
    return glm::distance(p, glm::dvec3(26, 30, 28)) < 22 || glm::distance(p, glm::dvec3(44, 30, 42)) < 18 ||
           (std::hypot(p.x - 24, p.y - 30) < (std::abs(p.z - 53) < 3 ? 6 : 10) && p.z > 48);
  });
}

class LargestRadius : public testing::TestWithParam<double> {};

TEST_P(LargestRadius, IsThatOfWhatStays) {
  Mask mask = heart_and_aorta();
  separate_chambers(mask, {.vessels_mm = {}, .not_vessels_mm = {}, .max_radius_mm = GetParam()}, "mask");
  const std::vector<float> distance_mm = distance_to_background_mm(mask);
  // The wall is half a voxel nearer than the next voxel outside.
  EXPECT_LE(*std::ranges::max_element(distance_mm) - 0.5, GetParam());
  // The aorta is twenty voxels wide, and stays whole beyond its valve.
  EXPECT_EQ(mask.at({24, 30, 90}), GetParam() > 10);
  EXPECT_EQ(mask.at({24, 30, 119}), GetParam() > 10);
}

INSTANTIATE_TEST_SUITE_P(OfVessels, LargestRadius, testing::Values(6, 8, 11, 12, 13, 14, 15, 16, 17));

TEST(Watershed, TakesOffMoreTheSmallerTheRadiusIs) {
  Mask more({.size = {64, 60, 120}});
  for (const double radius_mm : {6.0, 8.0, 11.0, 14.0, 17.0, 20.0, 23.0}) {
    Mask mask = heart_and_aorta();
    separate_chambers(mask, {.vessels_mm = {}, .not_vessels_mm = {}, .max_radius_mm = radius_mm}, "mask");
    EXPECT_TRUE(std::ranges::equal(more.voxels, mask.voxels, std::ranges::less_equal())) << radius_mm;
    more = mask;
  }
}

TEST(Watershed, LeavesAStenosisTogether) {
  const VolumeGeometry grid{.size = {30, 30, 80}};
  Mask mask = mask_where(grid, [](const glm::dvec3& p) {
    return std::hypot(p.x - 15, p.y - 15) < (std::abs(p.z - 40) < 4 ? 5 : 8);
  });
  const Mask before = mask;
  separate_chambers(mask, {}, "mask");
  EXPECT_EQ(mask.voxels, before.voxels);
}

TEST(Watershed, RefusesAPointInTheDark) {
  Mask mask = mask_where({.size = {30, 30, 30}}, [](const glm::dvec3& p) { return p.x < 5; });
  EXPECT_THROW(separate_chambers(mask, {.vessels_mm = {{25, 15, 15}}, .not_vessels_mm = {}}, "mask"),
               InputError);
}

TEST(Selection, KeepsAWideVesselOfWhichTheScanShowsAShortStretch) {
  const VolumeGeometry grid{.size = {60, 60, 70}};
  const auto aorta = [](const glm::dvec3& p) { return std::hypot(p.x - 20, p.y - 30) < 12; };
  const auto vein = [](const glm::dvec3& p) { return std::hypot(p.x - 50, p.y - 30) < 4; };
  const Mask mask = mask_where(grid, [&](const glm::dvec3& p) { return aorta(p) || vein(p); });
  EXPECT_EQ(select_vessels(mask, {}, "mask").voxels, mask.voxels);
}

TEST(Selection, LeavesPlatesAndLumps) {
  const VolumeGeometry grid{.size = {80, 80, 80}};
  const auto vessel = [](const glm::dvec3& p) { return std::hypot(p.x - 20, p.y - 20) < 4; };
  const auto plate = [](const glm::dvec3& p) { return p.y > 70 && p.y < 74; };
  const auto lump = [](const glm::dvec3& p) { return glm::distance(p, glm::dvec3(50, 40, 40)) < 12; };
  const Mask mask = mask_where(grid, [&](const glm::dvec3& p) { return vessel(p) || plate(p) || lump(p); });
  EXPECT_EQ(select_vessels(mask, {}, "mask").voxels, mask_where(grid, vessel).voxels);
}

/// The crescent of a right ventricle around a left one that is 55 mm long.
Mask ventricle(const VolumeGeometry& grid, std::mt19937& random) {
  std::uniform_real_distribution<double> angle(0, 2 * std::numbers::pi), shift(6, 9), radius(24, 28);
  const double phi = angle(random), shift_mm = shift(random), radius_mm = radius(random);
  const glm::dvec3 outer_mm(38, 38, 60),
      inner_mm = outer_mm - shift_mm * glm::dvec3(std::cos(phi), std::sin(phi), 0);
  const auto is_in = [&](const glm::dvec3& p, const glm::dvec3& middle_mm, double across_mm) {
    return glm::length((p - middle_mm) / glm::dvec3(across_mm, across_mm, 2 * across_mm)) < 1;
  };
  return mask_where(grid, [&](const glm::dvec3& p) {
    return is_in(p, outer_mm, radius_mm) && !is_in(p, inner_mm, radius_mm - 2);
  });
}

/// A vessel along the scan, off which some hundred thin ones fork that fork again.
Mask malformation(const VolumeGeometry& grid, std::mt19937& random) {
  std::uniform_real_distribution<double> across(4, 72), along(4, 116), share(0, 1);
  struct Tube {
    glm::dvec3 from, to;
    double radius;
  };
  std::vector<Tube> tubes{{{38, 38, -5}, {38, 38, 125}, 5}};
  for (int i = 0; i < 220; ++i) {
    const Tube& parent = tubes[i < 50 ? 0 : static_cast<std::size_t>(50 * share(random))];
    const glm::dvec3 from = glm::mix(parent.from, parent.to, share(random));
    tubes.push_back({from, {across(random), across(random), along(random)}, 1.5});
  }
  return mask_where(grid, [&](const glm::dvec3& p) {
    return std::ranges::any_of(
        tubes, [&](const Tube& tube) { return distance_to_segment(p, tube.from, tube.to) < tube.radius; });
  });
}

/// How often a component's volume holds a tube as wide as it and as long as its box's diagonal.
double tubes_in(const Mask& mask) {
  const std::vector<float> distance_mm = distance_to_background_mm(mask);
  const double radius = *std::ranges::max_element(distance_mm);
  const Box box = bounding_box(mask);
  return static_cast<double>(mask.count()) /
         (std::numbers::pi * radius * radius * glm::length(glm::dvec3(box.upper - box.lower)));
}

TEST(Selection, TellsAMalformationFromAVentricleOfAsMuchVolume) {
  const VolumeGeometry grid{.size = {76, 76, 120}};
  for (unsigned seed = 1; seed <= 3; ++seed) {
    std::mt19937 random(seed);
    const Mask vessels = malformation(grid, random);
    EXPECT_GT(tubes_in(vessels), 2.5) << seed;  // more than a tree of few branches has
    // Some voxels' tips touch no other.
    EXPECT_GT(select_vessels(vessels, {}, "mask").count(), vessels.count() * 99 / 100) << seed;

    Mask chamber = ventricle(grid, random);
    EXPECT_GT(tubes_in(chamber), 2.5) << seed;
    const Mask beside =
        mask_where(grid, [](const glm::dvec3& p) { return std::hypot(p.x - 8, p.y - 8) < 4; });
    for (std::size_t i = 0; i < chamber.voxels.size(); ++i) chamber.voxels[i] |= beside.voxels[i];
    EXPECT_EQ(select_vessels(chamber, {}, "mask").voxels, beside.voxels) << seed;
  }
}

// ---- spongy bone ----------------------------------------------------------------------------------

constexpr double kNone = 0;

/// How much of what `shape` holds is taken for spongy bone, with bone where `bone` is.
template <typename Shape, typename Bone>
double trabecular_share(const Shape& shape, const Bone& bone) {
  const VolumeGeometry grid{.size = {60, 60, 60}, .spacing_mm = {0.6, 0.6, 0.6}};
  const Mask mask = mask_where(grid, shape);
  const Mask spongy = find_trabecular_bone(mask, mask_where(grid, bone));
  EXPECT_TRUE(std::ranges::equal(spongy.voxels, mask.voxels, std::ranges::less_equal()));
  return static_cast<double>(spongy.count()) / static_cast<double>(mask.count());
}

const auto kNowhere = [](const glm::dvec3&) { return false; };

TEST(SpongyBone, IsALayerOfAnyDirectionUpToItsThickness) {
  const glm::dvec3 middle(17.7, 17.7, 17.7);
  for (const glm::dvec3& along : {glm::dvec3(0, 0, 1), glm::dvec3(1, 2, 2), glm::dvec3(1, 0, 1)}) {
    const auto layer = [&](double thickness_mm) {
      return [=](const glm::dvec3& p) {
        return std::abs(glm::dot(p - middle, glm::normalize(along))) < 0.5 * thickness_mm;
      };
    };
    // A layer's border along the grid's, where the ball reaches out of the grid, may stay.
    for (const double thickness_mm : {1.3, 2.0, 3.6})
      EXPECT_GT(trabecular_share(layer(thickness_mm), kNowhere), 0.8)
          << thickness_mm << " " << along.x << along.y;
    EXPECT_EQ(trabecular_share(layer(7), kNowhere), kNone);
  }
}

TEST(SpongyBone, IsNoVesselAndNoFork) {
  for (const double radius_mm : {0.9, 1.5, 2.4, 6.0}) {
    EXPECT_EQ(trabecular_share(
                  [&](const glm::dvec3& p) {
                    return distance_to_segment(p, {18, 18, -9}, {18, 18, 18}) < radius_mm ||
                           distance_to_segment(p, {18, 18, 18}, {2, 18, 45}) < radius_mm ||
                           distance_to_segment(p, {18, 18, 18}, {34, 22, 45}) < radius_mm;
                  },
                  kNowhere),
              kNone)
        << "radius " << radius_mm;
  }
}

TEST(SpongyBone, IsNoVesselThatLeavesAThickOne) {
  EXPECT_EQ(trabecular_share(
                [](const glm::dvec3& p) {
                  return distance_to_segment(p, {18, 18, -9}, {18, 18, 45}) < 8 ||
                         distance_to_segment(p, {18, 18, 18}, {45, 18, 24}) < 1.5;
                },
                kNowhere),
            kNone);
}

TEST(SpongyBone, IsWhatBoneSurrounds) {
  const auto distance = [](const glm::dvec3& p) { return distance_to_segment(p, {18, 18, 6}, {18, 18, 30}); };
  const auto rod = [&](const glm::dvec3& p) { return distance(p) < 2; };
  EXPECT_EQ(trabecular_share(rod, [&](const glm::dvec3& p) { return distance(p) >= 2 && distance(p) < 5; }),
            1);
  // A vessel that lies on a bone has half of its surroundings free.
  EXPECT_EQ(trabecular_share(rod, [&](const glm::dvec3& p) { return distance(p) >= 2 && p.x > 18; }), kNone);
}

// ---- gap_closing --------------------------------------------------------------------------------------

struct Bridge : testing::Test {
  const VolumeGeometry grid{.size = {40, 40, 80}};
  const Mask vessel =
      mask_where(grid, [](const glm::dvec3& p) { return std::hypot(p.x - 20, p.y - 20) < 3.5; });
  Mask without(double low_z, double high_z) const {
    Mask result = vessel;
    for (std::int64_t z = 0; z < grid.size.z; ++z)
      for (std::int64_t i = 0; i < grid.slice_voxels(); ++i)
        if (static_cast<double>(z) > low_z && static_cast<double>(z) < high_z)
          result.voxels[static_cast<std::size_t>(z * grid.slice_voxels() + i)] = 0;
    return result;
  }
};

TEST_F(Bridge, LeadsThroughWhatWasTakenOff) {
  Mask mask = without(30, 50);
  close_gaps(mask, vessel);
  EXPECT_EQ(Components(mask).count(), 1);
  // As thick as it may be, but for the rounding of a ball of 2.5 voxels.
  EXPECT_GE(mask.count() - without(30, 50).count(), 19 * 13);
  for (std::size_t i = 0; i < mask.voxels.size(); ++i) ASSERT_LE(mask.voxels[i], vessel.voxels[i]);
}

TEST_F(Bridge, IsNotLongerThanACanalNorThanWhatItJoins) {
  for (const auto& [low_z, high_z] : {std::pair(15, 58), std::pair(56, 77)}) {
    Mask mask = without(low_z, high_z);
    const Mask before = mask;
    close_gaps(mask, vessel);
    EXPECT_EQ(mask.voxels, before.voxels) << low_z;
  }
}

TEST_F(Bridge, NeedsACandidate) {
  Mask mask = without(38, 42);
  const Mask before = mask;
  close_gaps(mask, before);
  EXPECT_EQ(mask.voxels, before.voxels);
}

TEST(Surface, IsWatertightAndKeepsTheVolume) {
  const VolumeGeometry grid{.size = {50, 40, 60}, .spacing_mm = {0.8, 0.8, 1}, .origin_mm = {-5, 7, 100}};
  const Mask mask = mask_where(grid, [](const glm::dvec3& p) {
    return distance_to_segment(p, {10, 20, 100}, {25, 25, 150}) < 3 ||
           distance_to_segment(p, {14, 22, 115}, {5, 30, 150}) < 1.5;
  });
  for (const std::size_t triangles : {std::size_t{100'000}, std::size_t{2'000}}) {
    const Mesh mesh = surface_of(mask, triangles);
    EXPECT_TRUE(is_watertight(mesh));
    // What the README promises.
    EXPECT_NEAR(volume_mm3(mesh) / (static_cast<double>(mask.count()) * 0.8 * 0.8), 1, 0.03);
  }
}

}  // namespace
}  // namespace xraycast::segment_steps_test
