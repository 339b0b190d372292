#include "xraycast/geometry/nurbs_curve.hpp"

#include "xraycast/base/error.hpp"

#include <glm/geometric.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <numbers>

namespace xraycast::nurbs_curve_test {
namespace {

// Sums of ten or so products of lengths up to 100 mm in double precision.
constexpr double kRounding = 1e-11;

NurbsCurve catheter() {
  return NurbsCurve::cubic({{0, 0, 0}, {0, 5, 30}, {10, 5, 60}, {25, -10, 75}, {25, -30, 60}, {10, -40, 40}},
                           "catheter");
}

/// Points of unlike weights, and a knot that is there twice.
NurbsCurve rational() {
  return {
      3,
      {{{0, 0, 0}, 1}, {{10, 0, 5}, 3}, {{10, 10, 0}, 0.5}, {{0, 20, 0}, 2}, {{5, 30, 9}, 1}, {{9, 9, 9}, 1}},
      {0, 0, 0, 0, 0.4, 0.4, 1, 1, 1, 1},
      "rational"};
}

TEST(NurbsCurve, StartsAndEndsAtItsEndPointsAlongItsPolygon) {
  constexpr double kStep = 1e-6, kBend = 1e-9;  // the chord of so short a piece turns by less
  for (const NurbsCurve& curve : {catheter(), rational()}) {
    const auto& points = curve.points();
    EXPECT_LT(glm::distance(curve.at_mm(0), points.front().position_mm), kRounding);
    EXPECT_LT(glm::distance(curve.at_mm(1), points.back().position_mm), kRounding);
    const glm::dvec3 first = glm::normalize(points[1].position_mm - points[0].position_mm);
    EXPECT_NEAR(glm::dot(glm::normalize(curve.at_mm(kStep) - curve.at_mm(0)), first), 1, kBend);
    const glm::dvec3 last = glm::normalize(points.back().position_mm - points[points.size() - 2].position_mm);
    EXPECT_NEAR(glm::dot(glm::normalize(curve.at_mm(1) - curve.at_mm(1 - kStep)), last), 1, kBend);
  }
}

TEST(NurbsCurve, MakesAnExactCircle) {
  // Four quarters, each a conic whose middle point is the corner of the square around it (Fig. 7.16).
  constexpr double kRadius_mm = 12, kCorner = std::numbers::sqrt2 / 2;
  const glm::dvec3 centre{3, -4, 5}, x{0, kRadius_mm, 0}, y{0, 0, kRadius_mm};
  const NurbsCurve circle(2,
                          {{centre + x, 1},
                           {centre + x + y, kCorner},
                           {centre + y, 1},
                           {centre - x + y, kCorner},
                           {centre - x, 1},
                           {centre - x - y, kCorner},
                           {centre - y, 1},
                           {centre + x - y, kCorner},
                           {centre + x, 1}},
                          {0, 0, 0, 0.25, 0.25, 0.5, 0.5, 0.75, 0.75, 1, 1, 1}, "circle");
  for (int i = 0; i <= 400; ++i) {
    const glm::dvec3 p = circle.at_mm(i / 400.0);
    EXPECT_NEAR(glm::distance(p, centre), kRadius_mm, kRounding) << i;
    EXPECT_NEAR(p.x, centre.x, kRounding) << i;
  }
  EXPECT_LT(glm::distance(circle.at_mm(0.25), centre + y), kRounding);
}

struct BadCurve {
  const char* name;
  int degree;
  std::vector<NurbsCurve::ControlPoint> points;
  std::vector<double> knots;
  const char* message;
};

void PrintTo(const BadCurve& bad, std::ostream* out) { *out << bad.name; }

const std::vector<NurbsCurve::ControlPoint> kThree{{{0, 0, 0}}, {{1, 0, 0}}, {{2, 0, 0}}};

class RefusedNurbsCurve : public testing::TestWithParam<BadCurve> {};

TEST_P(RefusedNurbsCurve, NamesWhatIsWrong) {
  const BadCurve& bad = GetParam();
  try {
    const NurbsCurve curve(bad.degree, bad.points, bad.knots, "wire");
    FAIL() << "accepted";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), ::testing::StartsWith("wire: "));
    EXPECT_THAT(error.what(), ::testing::HasSubstr(bad.message));
  }
}

INSTANTIATE_TEST_SUITE_P(
    Bad, RefusedNurbsCurve,
    testing::Values(BadCurve{"Degree", 0, kThree, {}, "degree 0"},
                    BadCurve{"TooFewPoints", 3, kThree, {0, 0, 0, 0, 1, 1, 1}, "needs at least 4"},
                    BadCurve{"NotFinite",
                             1,
                             {{{0, 0, 0}}, {{std::numeric_limits<double>::quiet_NaN(), 0, 0}}},
                             {0, 0, 1, 1},
                             "control point 1"},
                    BadCurve{"Weight", 1, {{{0, 0, 0}, 0}, {{1, 0, 0}}}, {0, 0, 1, 1}, "control point 0"},
                    BadCurve{"KnotCount", 1, kThree, {0, 0, 1, 1}, "4 knots"},
                    BadCurve{"Falling", 1, kThree, {0, 0, 1, 0.5, 1}, "the knots decrease"},
                    BadCurve{"NotClamped", 1, kThree, {0, 0.1, 0.5, 1, 1}, "must be 0"},
                    BadCurve{"Torn",
                             1,
                             {{{0, 0, 0}}, {{1, 0, 0}}, {{2, 0, 0}}, {{3, 0, 0}}},
                             {0, 0, 0.5, 0.5, 1, 1},
                             "knot 0.5"}),
    [](const auto& bad) { return bad.param.name; });

}  // namespace
}  // namespace xraycast::nurbs_curve_test
