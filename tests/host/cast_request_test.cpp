#include "xraycast/requests/cast_request.hpp"

#include "xraycast/base/error.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

namespace xraycast::cast_request_test {
namespace {

using Edges = std::vector<double>;

struct BadRequest {
  const char* name;
  CastRequest request;
  const char* message;  ///< a part of it
};

class BadCastRequest : public testing::TestWithParam<BadRequest> {};

TEST_P(BadCastRequest, IsRejectedByTheNameOfItsField) {
  try {
    check(GetParam().request);
    FAIL() << "accepted";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr(GetParam().message));
  }
}

const double kNan = std::numeric_limits<double>::quiet_NaN();

INSTANTIATE_TEST_SUITE_P(
    Fields, BadCastRequest,
    testing::Values(
        BadRequest{"NoLayers", {.layers = 0}, "`layers` 0: must be 1 to 256"},
        BadRequest{"TooManyLayers", {.layers = 257}, "`layers` 257: must be 1 to 256"},
        BadRequest{"NoAngles", {.angles = 0}, "0 angles, but there must be 1 to 16384"},
        BadRequest{"NoRadius", {.radius_mm = 0}, "`radius_mm` is 0 mm, but must be above 0"},
        BadRequest{"RadiusThatIsNoNumber", {.radius_mm = kNan}, "`radius_mm` is nan mm"},
        BadRequest{"NoEdges", {.radii = Edges{}}, "`radii` : must be equal-area"},
        BadRequest{"OneEdge", {.radii = Edges{4}}, "`radii` 4: must be equal-area"},
        BadRequest{"DescendingEdges", {.radii = Edges{4, 2}}, "does not exceed the one before it"},
        BadRequest{"EdgesThatAreNoNumbers", {.radii = Edges{0, kNan}}, "radii[1] is nan mm"},
        BadRequest{"EdgesOfOtherLayers",
                   {.layers = 3, .radii = Edges{0, 2, 4}},
                   "`radii` 0,2,4 makes 2 layers, but `layers` asks for 3; leave `layers` out"},
        BadRequest{"EdgesOfAnotherRadius",
                   {.radii = Edges{0, 2.5}, .radius_mm = 5},
                   "`radii` 0,2.5 ends at a radius other than `radius_mm` 5; leave `radius_mm` out"},
        BadRequest{"CentreOfOneNumber", {.centre_mm = {5}}, "`centre_mm` 5: must be X,Y in mm"},
        BadRequest{"CentreOfACylinderWithZ", {.centre_mm = {1, 2, 3}}, "`centre_mm` 1,2,3: must be X,Y"},
        BadRequest{"CentreThatIsNoNumber", {.centre_mm = {1, kNan}}, "a centre is not finite"},
        BadRequest{"TwoCentres",
                   {.centre_mm = {1, 1}, .centre_line = "l.csv"},
                   "`centre_mm` 1,1 and `centre_line` l.csv: give only one of them"},
        BadRequest{"TableOfCircles",
                   {.outline = ShellOutline::circle, .keep_table = true},
                   "leave out `keep_table` or `outline` circle"},
        BadRequest{"ViewsOfACylinder", {.views = 8}, "`views` does not apply to `projection` cylinder"},
        BadRequest{"LayersOfARectangle",
                   {.projection = RayLayout::rectangle, .layers = 8},
                   "`layers` does not apply to `projection` rectangle; leave it out"},
        BadRequest{"NoViews", {.projection = RayLayout::rectangle, .views = 0}, "0 views"},
        BadRequest{"CentreLineOfASphere",
                   {.projection = RayLayout::sphere, .centre_line = "l.csv"},
                   "`centre_line` does not apply to `projection` sphere"},
        BadRequest{"IodineOfAnOpacity", {.iodine = "m.nrrd"}, "`iodine` m.nrrd: needs a spectrum"},
        BadRequest{"BasisOfASphere",
                   {.projection = RayLayout::sphere, .knots_hu = Edges{}},
                   "only cylinder maps cast with an opacity have a basis"},
        BadRequest{"BasisOfASpectrum",
                   {.opacity = Spectrum("line", {{60, 1}}), .knots_hu = Edges{}},
                   "only cylinder maps cast with an opacity have a basis"},
        BadRequest{"DescendingKnots", {.knots_hu = Edges{0, -5}}, "`knots_hu` 0,-5: knot 1 at -5 HU"}),
    [](const auto& tested) { return tested.param.name; });

TEST(CastRequest, OfNothingButDefaultsIsAccepted) {
  for (const RayLayout ray_layout : {RayLayout::cylinder, RayLayout::sphere, RayLayout::rectangle})
    EXPECT_NO_THROW(check({.projection = ray_layout}));
}

TEST(CastRequest, TakesEdgesInMmAndAsShares) {
  for (const Edges& edges : {Edges{0, 0.5, 1}, Edges{0, 20, 30.5}})
    EXPECT_NO_THROW(check({.layers = 2, .radii = edges}));
  EXPECT_NO_THROW(check({.radii = Edges{0, 0.5, 1}, .radius_mm = 60}));
}

TEST(CastRequest, NamesRulesAndOutlines) {
  EXPECT_EQ(parse_radii_rule("near-skin"), RadiiRule::near_skin);
  EXPECT_EQ(parse_shell_outline("circle"), ShellOutline::circle);
  EXPECT_THROW(parse_radii_rule("thin"), InputError);
  EXPECT_THROW(parse_shell_outline("square"), InputError);
}

}  // namespace
}  // namespace xraycast::cast_request_test
