#include "support/reference.hpp"
#include "xraycast/casting/caster.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

namespace xraycast::test::caster_cl_test {
namespace {

// A ray adds up some hundred products of 24-bit floats, whose positions are good to 1e-5 voxel: 1e-5 of the
// largest value leaves a margin of two over what was seen.
constexpr double kFloat = 1e-5;

double water(double) { return 0.02; }

MuOfHu mu_of(const Opacity& opacity) {
  return [&opacity](double hu) { return opacity.mu_per_mm(hu); };
}

std::vector<float> cast_map(const Volume& volume, const MapGeometry& geometry,
                            const Opacity& opacity = Opacity::paper(),
                            ScanStorage storage = ScanStorage::bricks) {
  static ComputeDevice device;
  Progress progress;
  return cast(upload(device, volume, storage), geometry, opacity, progress).map.tau;
}

std::vector<double> expected_map(const Volume& volume, const MapGeometry& g, const MuOfHu& mu) {
  const std::vector<glm::dvec2> centres(static_cast<std::size_t>(g.height), g.centre_mm[0]);
  return reference_cylinder_map(volume, centres, g.radii_mm, g.width, g.step_mm, mu);
}

template <typename A, typename B>
double largest_difference(const A& a, const B& b) {
  double largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i)
    largest = std::max(largest, std::abs(double{a[i]} - double{b[i]}));
  return largest;
}

template <typename A>
double largest(const A& a) {
  return *std::ranges::max_element(a);
}

struct Case {
  const char* name;
  Index3 size;
  glm::dvec3 spacing_mm;
  std::vector<double> radii_mm;
  glm::dvec2 centre_mm;
  int angles;
};

void PrintTo(const Case& c, std::ostream* out) { *out << c.name; }

class CylinderMap : public testing::TestWithParam<Case> {
 protected:
  void SetUp() override {
    ASSERT_FALSE(ComputeDevice::list().empty()) << "these tests need an OpenCL device, such as PoCL";
  }
};

TEST_P(CylinderMap, EqualsTheReference) {
  const Volume volume = textured_volume(GetParam().size, GetParam().spacing_mm);
  const MapGeometry geometry =
      cylinder_map(volume.geometry(), GetParam().angles, GetParam().radii_mm, GetParam().centre_mm);
  std::vector<Opacity::Knot> knots;
  for (int i = 0; i < 64; ++i) knots.push_back({-1000.0 + 37 * i, 0.0003 * i * (1 + i % 3)});
  for (const Opacity& opacity :
       {Opacity::paper(), Opacity::bilinear(), Opacity("64 knots", knots), Opacity("constant", {{0, 0.02}}),
        Opacity("window", {{-100, 0.01}, {100, 0.03}})}) {
    const auto expected = expected_map(volume, geometry, mu_of(opacity));
    const auto actual = cast_map(volume, geometry, opacity);
    ASSERT_EQ(actual.size(), expected.size());
    EXPECT_LE(largest_difference(actual, expected), kFloat * largest(expected)) << opacity.name();
  }
}

TEST_P(CylinderMap, IsTheSameFromImages) {
  ComputeDevice device;
  if (!device.self_test().images) GTEST_SKIP() << "the device has no usable images";
  const Volume volume = textured_volume(GetParam().size, GetParam().spacing_mm);
  const MapGeometry geometry =
      cylinder_map(volume.geometry(), GetParam().angles, GetParam().radii_mm, GetParam().centre_mm);
  const auto bricks = cast_map(volume, geometry),
             images = cast_map(volume, geometry, Opacity::bilinear(), ScanStorage::image);
  // VALIDATION: nanodrr compares back ends to 1e-4 of the maximum; ours differ by rounding alone.
  EXPECT_LE(largest_difference(images, cast_map(volume, geometry, Opacity::bilinear())),
            1e-4 * largest(bricks));
}

TEST_P(CylinderMap, LayersAddUpToTheSingleCylinder) {
  const Volume volume = textured_volume(GetParam().size, GetParam().spacing_mm);
  const MapGeometry layered =
      cylinder_map(volume.geometry(), GetParam().angles, GetParam().radii_mm, GetParam().centre_mm);
  const MapGeometry single =
      cylinder_map(volume.geometry(), GetParam().angles,
                   {GetParam().radii_mm.front(), GetParam().radii_mm.back()}, GetParam().centre_mm);
  const auto shells = cast_map(volume, layered), whole = cast_map(volume, single);
  std::vector<float> sum(whole.size());
  for (std::size_t i = 0; i < shells.size(); ++i) sum[i % sum.size()] += shells[i];
  EXPECT_LE(largest_difference(sum, whole), kFloat * largest(whole));
}

INSTANTIATE_TEST_SUITE_P(
    Cast, CylinderMap,
    testing::Values(Case{"OneLayer", {60, 50, 20}, {1, 1, 2}, {0, 24}, {0, 0}, 90},
                    Case{"EightLayers",
                         {60, 50, 20},
                         {1, 1, 2},
                         shell_radii_mm(RadiiRule::equal_area, 8, 23.7),
                         {1.3, -2.6},
                         90},
                    Case{"OblongPixels",
                         {64, 40, 33},
                         {0.7, 1.3, 3},
                         shell_radii_mm(RadiiRule::equal_thickness, 5, 21),
                         {0.4, 0.1},
                         77},
                    Case{"BeyondTheSlice", {30, 30, 17}, {1, 1, 1}, {0, 10, 20, 60}, {5, -4}, 64},
                    Case{"ShellsThinnerThanAStep",
                         {40, 40, 5},
                         {1, 1, 1},
                         {0, 3.1, 3.2, 3.3, 3.9, 4.7, 4.8, 12},
                         {0, 0},
                         36},
                    Case{"HollowInside", {40, 40, 16}, {1, 1, 1}, {4.4, 9, 15.2}, {0, 0}, 36},
                    Case{"OneVoxel", {1, 1, 1}, {1, 1, 1}, {0, 5}, {0, 0}, 8},
                    Case{"OneRow", {50, 1, 3}, {1, 1, 1}, {0, 30}, {0, 0}, 16}),
    [](const auto& c) { return c.param.name; });

TEST(CylinderCast, HomogeneousMatterGivesMuTimesThickness) {
  const Volume volume = make_volume({128, 128, 18}, {1, 1, 1}, [](const glm::dvec3&) { return 0; });
  const MapGeometry geometry =
      cylinder_map(volume.geometry(), 360, shell_radii_mm(RadiiRule::equal_area, 8, 60), {0, 0});
  const auto tau = cast_map(volume, geometry);
  const std::size_t layer = 360 * 18;
  for (std::size_t i = 0; i < tau.size(); ++i) {
    const double thickness_mm = geometry.radii_mm[i / layer + 1] - geometry.radii_mm[i / layer];
    ASSERT_NEAR(tau[i], water(0) * thickness_mm, kFloat * water(0) * 60) << "texel " << i;
  }
}

/// Half axes of 60 and 35 mm, from the axis at (2, -3).
std::vector<float> ellipse(const MapGeometry& geometry) {
  std::vector<float> outline_mm;
  for (int i = 0; i < geometry.width; ++i) {
    const double phi = geometry.phi_rad(i);
    outline_mm.push_back(static_cast<float>(1 / std::hypot(std::sin(phi) / 60, std::cos(phi) / 35)));
  }
  return outline_mm;
}

TEST(OutlinedCast, HomogeneousMatterGivesMuTimesTheShellsThicknessInThatDirection) {
  const Volume volume = make_volume({128, 128, 18}, {1, 1, 1}, [](const glm::dvec3&) { return 0; });
  const MapGeometry circles =
      cylinder_map(volume.geometry(), 360, shell_radii_mm(RadiiRule::near_skin, 8, 60), {2, -3});
  const MapGeometry geometry = with_outline(circles, ellipse(circles));
  const auto tau = cast_map(volume, geometry);
  const std::size_t layer = 360 * 18;
  for (std::size_t i = 0; i < tau.size(); ++i) {
    const double thickness_mm = (geometry.radii_mm[i / layer + 1] - geometry.radii_mm[i / layer]) *
                                geometry.outline_mm[i % 360] / geometry.radius_mm();
    ASSERT_NEAR(tau[i], water(0) * thickness_mm, kFloat * water(0) * 60) << "texel " << i;
  }
}

TEST(OutlinedCast, OfAConstantOutlineIsThatOfTheCircleBitForBit) {
  const Volume volume = textured_volume({60, 50, 20}, {1, 1, 2});
  const MapGeometry circles =
      cylinder_map(volume.geometry(), 90, shell_radii_mm(RadiiRule::equal_area, 8, 24), {1, -2});
  const MapGeometry same = with_outline(circles, std::vector<float>(90, 24));
  EXPECT_EQ(cast_map(volume, circles), cast_map(volume, same));
}

TEST(OutlinedCast, LayersAddUpToOneAndRowsOfTheirOwnAreCastAlike) {
  const Volume volume = textured_volume({60, 50, 20}, {1, 1, 2});
  const MapGeometry circles = cylinder_map(volume.geometry(), 90, {0, 30}, {1, -2});
  std::vector<float> outline_mm;
  for (int i = 0; i < 90; ++i) outline_mm.push_back(static_cast<float>(23 + 5 * std::sin(0.2 * i)));
  MapGeometry one = with_outline(circles, outline_mm), many = one;
  many.radii_mm = shell_radii_mm(RadiiRule::near_skin, 7, one.radius_mm());
  const auto single = cast_map(volume, one), layers = cast_map(volume, many);
  std::vector<double> sum(single.size(), 0);
  for (std::size_t i = 0; i < layers.size(); ++i) sum[i % single.size()] += layers[i];
  // 1e-5 relative, of sums of 7 floats each.
  EXPECT_LE(largest_difference(sum, single), 1e-5 * largest(single));

  MapGeometry of_rows = many;
  of_rows.outline_mm.clear();
  for (int row = 0; row < of_rows.height; ++row)
    of_rows.outline_mm.insert(of_rows.outline_mm.end(), outline_mm.begin(), outline_mm.end());
  // One slice at a time in place of sixteen adds the same up in another order.
  EXPECT_LE(largest_difference(cast_map(volume, of_rows), layers), kFloat * largest(layers));
}

/// Two outlines, the second from a row on.
MapGeometry banded(const MapGeometry& circles, const std::vector<float>& upper_mm,
                   const std::vector<float>& lower_mm, int first_lower_row) {
  std::vector<float> rows_mm;
  for (int row = 0; row < circles.height; ++row) {
    const std::vector<float>& outline_mm = row < first_lower_row ? upper_mm : lower_mm;
    rows_mm.insert(rows_mm.end(), outline_mm.begin(), outline_mm.end());
  }
  return with_outline(circles, std::move(rows_mm));
}

TEST(OutlinedCast, EveryBandOfRowsIsCastAsIfItsOutlineWereTheOnlyOne) {
  const Volume volume = textured_volume({60, 50, 53}, {1, 1, 2});
  const MapGeometry circles =
      cylinder_map(volume.geometry(), 90, shell_radii_mm(RadiiRule::near_skin, 7, 28), {1, -2});
  std::vector<float> wide_mm, narrow_mm;
  for (int i = 0; i < 90; ++i) {
    wide_mm.push_back(i == 0 ? 28 : static_cast<float>(23 + 5 * std::sin(0.2 * i)));
    narrow_mm.push_back(static_cast<float>(15 + 3 * std::cos(0.3 * i)));
  }
  // The narrow one's rays as long as the wide one's, in whose units the radii are.
  std::vector<float> narrow_to_wide_mm = narrow_mm;
  narrow_to_wide_mm[0] = 28;
  const auto wide = cast_map(volume, with_outline(circles, wide_mm)),
             narrow = cast_map(volume, with_outline(circles, narrow_to_wide_mm));
  // Between two bricks of sixteen slices, counted from below, and within one.
  for (const int border : {53 - 32, 53 - 37}) {
    const auto both = cast_map(volume, banded(circles, narrow_mm, wide_mm, border));
    double largest_error = 0;
    for (std::size_t i = 0; i < both.size(); ++i) {
      const int row = static_cast<int>(i / 90 % 53), column = static_cast<int>(i % 90);
      if (row < border && column == 0) continue;  // of the direction that was made as long
      largest_error = std::max<double>(largest_error, std::abs(both[i] - (row < border ? narrow : wide)[i]));
    }
    // Within a brick one slice at a time is cast, which adds the same up in another order.
    EXPECT_LE(largest_error, kFloat * largest(wide)) << border;
  }
}

TEST(CylinderCast, OffAxisCylindersMatchTheirClosedForm) {
  const glm::dvec2 axis_mm(3, -4), circle_mm(20, 12);
  // The edge falls over one voxel, so that voxels hold what is in them.
  const Volume volume = make_volume({160, 160, 16}, {1, 1, 1}, [&](const glm::dvec3& p) {
    return -1024 + 1024 * std::clamp(0.5 + 30 - std::hypot(p.x - circle_mm.x, p.y - circle_mm.y), 0.0, 1.0);
  });
  const MapGeometry geometry = cylinder_map(volume.geometry(), 360, {0, 20, 40, 70}, axis_mm);
  const auto tau = cast_map(volume, geometry);
  for (int k = 0; k < 3; ++k) {
    for (int column = 0; column < 360; ++column) {
      const double chord_mm = radial_circle_chord_mm(axis_mm, geometry.phi_rad(column), geometry.radii_mm[k],
                                                     geometry.radii_mm[k + 1], circle_mm, 30);
      // Where a ray grazes the circle, the one-voxel edge changes its chord by up to sqrt(2 * 30 mm * 0.5
      // mm); across the edge, by the error of the step, 1 mm.
      const double tolerance_mm = chord_mm > 0 && chord_mm < 12 ? 5.5 : 1;
      ASSERT_NEAR(tau[static_cast<std::size_t>((k * 16 + 5) * 360 + column)], water(0) * chord_mm,
                  water(0) * tolerance_mm)
          << "layer " << k << ", column " << column;
    }
  }
}

TEST(CylinderCast, OffAxisBoxesMatchTheirClosedForm) {
  const Box box{{-10.5, 8.5, -100}, {31.5, 40.5, 100}};
  const Volume volume = make_volume({128, 128, 16}, {1, 1, 1},
                                    [&](const glm::dvec3& p) { return box.contains(p) ? 0 : -1024; });
  const MapGeometry geometry = cylinder_map(volume.geometry(), 360, {0, 60}, {0, 0});
  const auto tau = cast_map(volume, geometry);
  double worst_mm = 0, mean_mm = 0;
  for (int column = 0; column < 360; ++column) {
    const double chord_mm = radial_box_chord_mm({0, 0}, geometry.phi_rad(column), 0, 60,
                                                glm::dvec2(box.lower_mm), glm::dvec2(box.upper_mm));
    const double error_mm = std::abs(tau[static_cast<std::size_t>(column)] / water(0) - chord_mm);
    worst_mm = std::max(worst_mm, error_mm);
    mean_mm += error_mm / 360;
  }
  // A ray along a face moves through the half-filled voxels there, of which the longest run is a corner's
  // few.
  EXPECT_LE(worst_mm, 6);
  // Both faces at most half a step off.
  EXPECT_LE(mean_mm, 0.5);
}

TEST(CylinderCast, PatientsLeftIsAQuarterAround) {
  const Volume volume = make_volume({64, 64, 16}, {1, 1, 1}, [](const glm::dvec3& p) {
    return p.x > 15 && std::abs(p.y) < 3 && p.z > 0 ? 1000 : -1024;
  });
  const auto tau = cast_map(volume, cylinder_map(volume.geometry(), 360, {0, 30}, {0, 0}));
  EXPECT_GT(tau[90], 0.1);           // superior row, towards the left
  EXPECT_EQ(tau[0], 0);              // anterior
  EXPECT_EQ(tau[270], 0);            // right
  EXPECT_EQ(tau[15 * 360 + 90], 0);  // most inferior row
}

TEST(CylinderCast, AQuarterTurnOfTheScanShiftsTheMapByAQuarter) {
  const Volume volume = textured_volume({64, 64, 20}, {1, 1, 1});
  Volume turned(volume.geometry());
  for (std::int64_t z = 0; z < 20; ++z)
    for (std::int64_t y = 0; y < 64; ++y)
      for (std::int64_t x = 0; x < 64; ++x)
        turned.at(63 - y, x, z) = volume.at(x, y, z);  // anterior becomes left
  const MapGeometry geometry = cylinder_map(volume.geometry(), 360, {0, 15, 30}, {0, 0});
  const auto before = cast_map(volume, geometry), after = cast_map(turned, geometry);
  std::vector<float> shifted(before.size());
  for (std::size_t i = 0; i < before.size(); ++i) shifted[i - i % 360 + (i % 360 + 90) % 360] = before[i];
  EXPECT_LE(largest_difference(after, shifted), kFloat * largest(before));
}

TEST(CylinderCast, TheSeamIsContinuous) {
  const Volume volume = make_volume({128, 128, 16}, {1, 1, 1},
                                    [](const glm::dvec3& p) { return 300 * std::sin(p.x / 20) + 5 * p.y; });
  const auto tau = cast_map(volume, cylinder_map(volume.geometry(), 360, {0, 55}, {0, 0}));
  double steepest = 0;
  for (std::size_t i = 0; i + 1 < 360; ++i)
    steepest = std::max(steepest, double{std::abs(tau[i + 1] - tau[i])});
  EXPECT_LE(std::abs(tau[0] - tau[359]), steepest);
}

TEST(CylinderCast, GivesTheSameOnEveryDevice) {
  const Volume volume = textured_volume({60, 50, 20}, {1, 1, 2});
  const MapGeometry geometry =
      cylinder_map(volume.geometry(), 90, shell_radii_mm(RadiiRule::equal_area, 8, 24), {0, 0});
  const auto expected = expected_map(volume, geometry, mu_of(Opacity::paper()));
  for (const ComputeDevice::Info& info : ComputeDevice::list()) {
    ComputeDevice device(std::to_string(info.index));
    Progress progress;
    const auto tau = cast(upload(device, volume), geometry, Opacity::paper(), progress).map.tau;
    // As nanodrr compares its back ends.
    EXPECT_LE(largest_difference(tau, expected), 1e-4 * largest(expected)) << info.name;
  }
}

}  // namespace
}  // namespace xraycast::test::caster_cl_test
