#include "xraycast/geometry/nurbs_curve.hpp"

#include "xraycast/base/error.hpp"

#include <glm/geometric.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

namespace xraycast {
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

TEST(NurbsCurve, BasisIsAPartitionOfUnity) {
  for (const NurbsCurve& curve : {catheter(), rational(), NurbsCurve::circle({}, {9, 0, 0}, {0, 9, 0})})
    for (int i = 0; i <= 1000; ++i) {
      const std::vector<double> basis = curve.basis(i / 1000.0);
      ASSERT_EQ(basis.size(), curve.points().size());
      EXPECT_NEAR(std::accumulate(basis.begin(), basis.end(), 0.0), 1, kRounding) << i;
      EXPECT_THAT(basis, ::testing::Each(::testing::Ge(0.0))) << i;
    }
}

TEST(NurbsCurve, PointIsTheBasisTimesTheControlPoints) {
  const NurbsCurve curve = rational();
  for (const double t : {0.0, 0.1, 0.4, 0.77, 1.0}) {
    const std::vector<double> basis = curve.basis(t);
    glm::dvec3 sum{0};
    for (std::size_t i = 0; i < basis.size(); ++i) sum += basis[i] * curve.points()[i].position_mm;
    EXPECT_LT(glm::distance(curve.at_mm(t), sum), kRounding) << t;
  }
}

TEST(NurbsCurve, StartsAndEndsAtItsEndPointsAlongItsPolygon) {
  for (const NurbsCurve& curve : {catheter(), rational()}) {
    const auto& points = curve.points();
    EXPECT_LT(glm::distance(curve.at_mm(0), points.front().position_mm), kRounding);
    EXPECT_LT(glm::distance(curve.at_mm(1), points.back().position_mm), kRounding);
    const glm::dvec3 first = glm::normalize(points[1].position_mm - points[0].position_mm);
    EXPECT_NEAR(glm::dot(glm::normalize(curve.derivative_mm(0, 1)), first), 1, kRounding);
    const glm::dvec3 last = glm::normalize(points.back().position_mm - points[points.size() - 2].position_mm);
    EXPECT_NEAR(glm::dot(glm::normalize(curve.derivative_mm(1, 1)), last), 1, kRounding);
  }
}

TEST(NurbsCurve, DerivativesAreLimitsOfDifferences) {
  constexpr double kStep = 1e-5;
  for (const NurbsCurve& curve : {catheter(), rational()})
    for (const double t : {0.05, 0.2, 0.39, 0.6, 0.9}) {
      const glm::dvec3 before = curve.at_mm(t - kStep), here = curve.at_mm(t), after = curve.at_mm(t + kStep);
      // The central difference errs by step^2 / 6 times the third derivative, here below 1e5 mm.
      EXPECT_LT(glm::distance(curve.derivative_mm(t, 1), (after - before) / (2 * kStep)), 1e-4) << t;
      // Rounding of 1e-14 mm over step^2, and step^2 / 12 times the fourth derivative.
      EXPECT_LT(glm::distance(curve.derivative_mm(t, 2), (after - 2.0 * here + before) / (kStep * kStep)),
                0.01)
          << t;
    }
}

TEST(NurbsCurve, CircleIsOne) {
  const glm::dvec3 centre{3, -4, 5}, x{0, 12, 0}, y{0, 0, 12};
  const NurbsCurve circle = NurbsCurve::circle(centre, x, y);
  for (int i = 0; i <= 400; ++i) {
    const double t = i / 400.0;
    EXPECT_NEAR(glm::distance(circle.at_mm(t), centre), 12, kRounding) << t;
    EXPECT_NEAR(circle.at_mm(t).x, 3, kRounding) << t;
    EXPECT_NEAR(glm::dot(circle.derivative_mm(t, 1), circle.at_mm(t) - centre), 0, 1e3 * kRounding) << t;
    // kappa = |C' x C''| / |C'|^3 = 1 / radius.
    const glm::dvec3 first = circle.derivative_mm(t, 1);
    const double speed = glm::length(first);
    EXPECT_NEAR(glm::length(glm::cross(first, circle.derivative_mm(t, 2))) / (speed * speed * speed),
                1 / 12.0, kRounding)
        << t;
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
                    BadCurve{"Falling", 1, kThree, {0, 0, 1, 0.5, 1}, "fall"},
                    BadCurve{"NotClamped", 1, kThree, {0, 0.1, 0.5, 1, 1}, "have to be 0"},
                    BadCurve{"Torn",
                             1,
                             {{{0, 0, 0}}, {{1, 0, 0}}, {{2, 0, 0}}, {{3, 0, 0}}},
                             {0, 0, 0.5, 0.5, 1, 1},
                             "knot 0.5"}),
    [](const auto& bad) { return bad.param.name; });

}  // namespace
}  // namespace xraycast
