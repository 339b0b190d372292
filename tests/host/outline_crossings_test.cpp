#include "xraycast/casting/outline_crossings.hpp"

#include "xraycast/requests/rays_within.hpp"

#include <glm/geometric.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

namespace xraycast::outline_crossings_test {
namespace {

using Outline = std::function<double(double)>;  // R over phi

/// An outline of 720 columns about the origin.
MapGeometry outlined(const Outline& radius_mm) {
  MapGeometry geometry;
  geometry.width = 720;
  geometry.height = 10;
  geometry.radii_mm = {0, 60, 100};
  geometry.centre_mm = {{0, 0}};
  geometry.top_mm = 9;
  std::vector<float> outline_mm;
  for (int i = 0; i < geometry.width; ++i)
    outline_mm.push_back(static_cast<float>(radius_mm(geometry.phi_rad(i))));
  return with_outline(geometry, std::move(outline_mm));
}

double ellipse(double phi) { return 1 / std::hypot(std::sin(phi) / 100, std::cos(phi) / 60); }
double waist(double phi) { return 60 - 35 * std::cos(2 * phi); }  // narrow in front and behind

/// Where a line crosses the ellipse scaled by `share`: half of the chord.
double half_chord_mm(double share, double x_mm) {
  const double y = share * share - x_mm * x_mm / 1e4;
  return y > 0 ? 60 * std::sqrt(y) : 0;
}

TEST(OutlineCrossings, OfAnEllipseAreItsChords) {
  const MapGeometry geometry = outlined(ellipse);
  const OutlineCrossings outline(geometry);
  for (const double x : {-99.0, -80.0, -30.0, -1e-3, 0.0, 1e-9, 5.0, 64.0, 97.0}) {
    SCOPED_TRACE(x);
    const OutlineCrossings::Line line(outline, {x, 0}, {0, 1});
    const auto crossings = outline.crossings(line, geometry.radii_mm);
    std::vector<double> expected;
    for (const double share : {0.6, 1.0})
      if (const double half = half_chord_mm(share, x); half > 0) {
        expected.push_back(-half);
        expected.push_back(half);
      }
    std::ranges::sort(expected);
    ASSERT_EQ(crossings.size(), expected.size() + (x == 0 ? 0 : 0));
    // The outline is linear between columns half a degree apart; where the line grazes, 0.002 mm of R are
    // much of a chord.
    for (std::size_t i = 0; i < expected.size(); ++i)
      EXPECT_NEAR(crossings[i].along_mm, expected[i], std::abs(x) > 90 ? 0.05 : 0.005);
  }
}

TEST(OutlineCrossings, MayBeFourWhereTheOutlineIsConcave) {
  const MapGeometry geometry = outlined(waist);
  const OutlineCrossings outline(geometry);
  const OutlineCrossings::Line line(outline, {0, -40}, {1, 0});
  const auto crossings = outline.crossings(line, std::array{geometry.radius_mm()});
  ASSERT_EQ(crossings.size(), 4u);
  for (std::size_t i = 0; i < 4; ++i) {
    const glm::dvec2 p(crossings[i].along_mm, -40);
    // As above.
    EXPECT_NEAR(glm::length(p), waist(std::atan2(p.x, -p.y)), 0.005) << i;
    EXPECT_NEAR(crossings[i].along_mm, -crossings[3 - i].along_mm, 1e-3) << i;
  }
}

double length_mm(const std::vector<PixelSegment>& segments, std::size_t pixel) {
  double sum = 0;
  for (const PixelSegment& part : segments)
    if (part.pixel == pixel) sum += glm::distance(part.segment.start_mm, part.segment.end_mm);
  return sum;
}

TEST(SegmentsWithin, AnEllipticCylinderAreItsChords) {
  const MapGeometry geometry = outlined(ellipse);
  for (const double tilt : {0.0, 0.02}) {
    const View view{.cranial_rad = tilt, .centre_mm = {0, 0, 4.5}, .width = 190, .height = 1, .pixel_mm = 1};
    const auto segments = segments_within(view, geometry);
    for (int i = 0; i < view.width; ++i)
      EXPECT_NEAR(length_mm(segments, static_cast<std::size_t>(i)),
                  2 * half_chord_mm(1, i + 0.5 - 95) / std::cos(tilt), 0.05)
          << i;
  }
}

TEST(SegmentsWithin, ARayThroughAWaistAreTwo) {
  const MapGeometry geometry = outlined(waist);
  const View view{
      .lao_rad = std::acos(0.0), .centre_mm = {0, -40, 4.5}, .width = 1, .height = 1, .pixel_mm = 1};
  EXPECT_EQ(segments_within(view, geometry).size(), 2u);
}

TEST(SegmentsWithin, ASphereUnderAnOutlineOfEveryDirectionAreFoundToo) {
  // R = 50 mm everywhere, but said of every texel: the same as the circle's.
  MapGeometry sphere = outlined([](double) { return 50; });
  sphere.ray_layout = RayLayout::sphere;
  sphere.outline_mm.assign(static_cast<std::size_t>(sphere.width) * sphere.height, 50);
  const View view{.lao_rad = 0.4, .centre_mm = {0, 0, 0}, .width = 81, .height = 1, .pixel_mm = 1};
  const auto segments = segments_within(view, sphere);
  for (int i = 0; i < 81; ++i) {
    const double offset = i - 40;
    // Twenty halvings of a millimetre.
    EXPECT_NEAR(length_mm(segments, static_cast<std::size_t>(i)), 2 * std::sqrt(2500 - offset * offset), 1e-5)
        << i;
  }
}

}  // namespace
}  // namespace xraycast::outline_crossings_test
