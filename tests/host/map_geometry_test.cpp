#include "xraycast/casting/map_geometry.hpp"

#include "xraycast/base/error.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

namespace xraycast::map_geometry_test {
namespace {

VolumeGeometry chest() { return {{512, 512, 275}, {0.78, 0.78, 1.0}, {-200, -180, 40}}; }

TEST(ShellRadii, EqualAreaShellsHoldEqualAreas) {
  const auto radii = shell_radii_mm(RadiiRule::equal_area, 8, 200);
  ASSERT_EQ(radii.size(), 9u);
  EXPECT_EQ(radii.front(), 0);
  EXPECT_EQ(radii.back(), 200);
  for (std::size_t k = 0; k + 1 < radii.size(); ++k)
    // Rounding of squares of numbers up to 200.
    EXPECT_NEAR(radii[k + 1] * radii[k + 1] - radii[k] * radii[k], 200.0 * 200 / 8, 1e-9);
}

TEST(ShellRadii, EqualThicknessShellsAreEquallyThick) {
  EXPECT_THAT(shell_radii_mm(RadiiRule::equal_thickness, 4, 100), testing::ElementsAre(0, 25, 50, 75, 100));
}

TEST(ShellRadii, RefusesNoLayersAndNoRadius) {
  EXPECT_THROW(shell_radii_mm(RadiiRule::equal_area, 0, 100), InputError);
  EXPECT_THROW(shell_radii_mm(RadiiRule::equal_area, 8, 0), InputError);
  EXPECT_THROW(shell_radii_mm(RadiiRule::equal_area, 8, std::nan("")), InputError);
}

TEST(CylinderMap, HasARowForEverySliceSuperiorFirst) {
  const MapGeometry map = cylinder_map(chest(), 360, {0, 150}, {0, 0});
  EXPECT_EQ(map.height, 275);
  EXPECT_EQ(map.z_mm(0), 40 + 274);
  EXPECT_EQ(map.z_mm(274), 40);
}

TEST(CylinderMap, ColumnsAreCentredBetweenWholeSteps) {
  const MapGeometry map = cylinder_map(chest(), 360, {0, 150}, {0, 0});
  EXPECT_DOUBLE_EQ(map.phi_rad(0), 0.5 * std::numbers::pi / 180);
  EXPECT_DOUBLE_EQ(map.phi_rad(359), 359.5 * std::numbers::pi / 180);
}

TEST(CylinderMap, StepsEndAtTheRadiusAndAreAtMostAPixel) {
  const MapGeometry map = cylinder_map(chest(), 360, {0, 100, 150.3}, {0, 0});
  EXPECT_LE(map.step_mm, 0.78);
  const double steps = map.radius_mm() / map.step_mm;
  // Rounding of one division.
  EXPECT_NEAR(steps, std::round(steps), 1e-9);
}

struct BadMap {
  const char* name;
  int angles;
  std::vector<double> radii_mm;
  glm::dvec2 centre_mm;
  const char* message;
};

void PrintTo(const BadMap& bad, std::ostream* out) { *out << bad.name; }

TEST(MapGeometry, RaysReachTheFieldsBorderInWholeSamples) {
  // Voxels from -30.5 to 30.5 mm in x, from -45.5 to 45.5 mm in y and from -21 to 21 mm in z.
  const VolumeGeometry volume{{61, 91, 28}, {1, 1, 1.5}, {-30, -45, -20.25}};
  const MapGeometry cylinder = cylinder_map(volume, 360, {0, 20, 40}, {5.2, 0});
  // Columns 89 and 90 lie half a degree before and behind the patient's left.
  EXPECT_EQ(cylinder.reach_mm(89, 3), 25);
  EXPECT_EQ(cylinder.reach_mm(90, 3), 25);
  EXPECT_EQ(cylinder.reach_mm(270, 3), 36);
  EXPECT_EQ(cylinder.reach_mm(0, 3), 40);
  // At 125.5 deg it leaves after 25.3 / cos(35.5 deg) = 31.1 mm: the sample in the middle of the 31st mm is
  // within.
  EXPECT_EQ(cylinder.reach_mm(125, 3), 31);
  const MapGeometry sphere = sphere_map(volume, 360, {0, 20, 40}, {5.2, 0, 1});
  EXPECT_EQ(sphere.reach_mm(0, 0), 20);
  EXPECT_EQ(sphere.reach_mm(0, 179), 22);
  EXPECT_EQ(sphere.reach_mm(90, 90), 25);
  MapGeometry unknown = cylinder;
  unknown.field.reset();
  EXPECT_EQ(unknown.reach_mm(90, 3), 40);
}

/// A circle's map of 8 columns and 2 rows, 40 mm wide, with this outline.
MapGeometry outlined(std::vector<float> outline_mm) {
  MapGeometry circles = cylinder_map({{100, 100, 2}, {1, 1, 1}, {-49.5, -49.5, 0}}, 8, {0, 20, 40}, {0, 0});
  return with_outline(circles, std::move(outline_mm));
}

TEST(MapOutline, ShellsAreFractionsOfItsLargestRadius) {
  const MapGeometry map = outlined({10, 20, 30, 20, 10, 20, 30, 20});
  EXPECT_THAT(map.radii_mm, testing::ElementsAre(0, 15, 30));
  EXPECT_EQ(map.step_mm, 1);
  EXPECT_EQ(map.scale(2, 1), 1);
  EXPECT_NEAR(map.scale(0, 0), 1.0 / 3, 1e-7);  // of a 32-bit float
  // Half of the outline's way out is half of the shells', in the direction of a column and between two.
  EXPECT_NEAR(map.shell_radius_mm(5, 0, 0.3), 15, 1e-5);
  EXPECT_NEAR(map.shell_radius_mm(7.5, -0.5, 1), 15, 1e-5);
}

TEST(MapOutline, RaysReachTheFieldsBorderInTheirOwnSamples) {
  MapGeometry map = outlined({10, 20, 30, 20, 10, 20, 30, 20});
  map.field = FieldOfView{{-49.5, -5, 0}, {49.5, 49.5, 2}};
  // Column 0 is 22.5 deg from anterior: the border is 5.41 mm away, and its 30 samples are 1/3 mm long.
  EXPECT_EQ(map.reach_mm(0, 0), 16);
}

TEST(MapOutline, ThatCannotBeIsRefusedWithTheReason) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const std::vector<std::pair<std::vector<float>, const char*>> cases{
      {{10, 20, 30}, "an outline of 3 radii for 8 x 2 texels"},
      {{10, 20, 30, 20, 10, 0, 30, 20}, "a radius of 0 mm"},
      {{10, 20, 30, 20, 10, -4, 30, 20}, "a radius of -4 mm"},
      {{10, 20, 30, 20, 10, nan, 30, 20}, "a radius of nan mm"}};
  for (const auto& [outline_mm, message] : cases) try {
      outlined(outline_mm);
      ADD_FAILURE() << "accepted: " << message;
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), testing::HasSubstr(message));
    }
  MapGeometry other = outlined(std::vector<float>(8, 30));
  other.radii_mm = {0, 35};  // as of the narrower rows of a map
  EXPECT_NO_THROW(validate(other, "map"));
  other.radii_mm = {0, 25};
  EXPECT_THROW(validate(other, "map"), InputError);
}

class BadMapTest : public testing::TestWithParam<BadMap> {};

TEST_P(BadMapTest, IsRefusedWithTheReason) {
  try {
    cylinder_map(chest(), GetParam().angles, GetParam().radii_mm, GetParam().centre_mm);
    FAIL() << "accepted";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr(GetParam().message));
  }
}

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
INSTANTIATE_TEST_SUITE_P(CylinderMap, BadMapTest,
                         testing::Values(BadMap{"NoAngles", 0, {0, 100}, {0, 0}, "0 angles"},
                                         BadMap{"NegativeAngles", -5, {0, 100}, {0, 0}, "-5 angles"},
                                         BadMap{"TooManyAngles", 100000, {0, 100}, {0, 0}, "100000 angles"},
                                         BadMap{"OneRadius", 360, {100}, {0, 0}, "1 radii"},
                                         BadMap{"NoRadii", 360, {}, {0, 0}, "0 radii"},
                                         BadMap{"Descending", 360, {0, 50, 40}, {0, 0}, "radii[2]"},
                                         BadMap{"NegativeRadius", 360, {-1, 50}, {0, 0}, "radii[0]"},
                                         BadMap{"NaNRadius", 360, {0, kNaN}, {0, 0}, "radii[1]"},
                                         BadMap{"CentreOutside", 360, {0, 100}, {900, 0}, "outside the scan"},
                                         BadMap{"NaNCentre", 360, {0, 100}, {kNaN, 0}, "outside the scan"}),
                         [](const auto& bad) { return bad.param.name; });

}  // namespace
}  // namespace xraycast::map_geometry_test
