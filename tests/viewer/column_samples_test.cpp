#include "xraycast/sampling/column_samples.hpp"

#include "xraycast/base/error.hpp"

#include <glm/geometric.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <span>

namespace xraycast::column_samples_test {
namespace {

constexpr double kRadians = std::numbers::pi / 180;

MapGeometry map(std::vector<double> radii_mm, glm::dvec2 centre_mm = {12, -7}) {
  MapGeometry geometry;
  geometry.height = 8;
  geometry.radii_mm = std::move(radii_mm);
  geometry.centre_mm = {centre_mm};
  geometry.top_mm = 10;
  return geometry;
}

RectifiedView view_of_map(const MapGeometry& geometry, std::optional<Cone> cone = {}, double angle_deg = 35) {
  View view{.lao_rad = angle_deg * kRadians, .cone = cone, .centre_mm = {10, -5, 6}};
  return rectified_view(fitted(view, bounds_of(geometry)), geometry);
}

std::span<const ColumnSample> samples_of(const ColumnSamples& all, int column) {
  const auto& c = all.columns[static_cast<std::size_t>(column)];
  return std::span(all.samples).subspan(static_cast<std::size_t>(c.first), static_cast<std::size_t>(c.count));
}

/// How far a column's rays pass from the map's axis.
double offset_mm(const RectifiedView& rectified, const MapGeometry& geometry, int column) {
  const glm::dvec2 direction = rectified.direction(column),
                   from_axis = rectified.origin_mm(column) - geometry.centre_mm[0];
  return std::abs(from_axis.x * direction.y - from_axis.y * direction.x);
}

TEST(ColumnSamples, WeightsAddUpToTheChord) {
  const MapGeometry geometry = map({0, 30, 50, 100});
  for (const auto& cone : {std::optional<Cone>(), std::optional<Cone>(Cone{600, 900})}) {
    const RectifiedView rectified = view_of_map(geometry, cone);
    const ColumnSamples samples = column_samples(rectified, geometry, {});
    ASSERT_EQ(samples.columns.size(), static_cast<std::size_t>(rectified.columns));
    for (int column = 0; column < rectified.columns; ++column) {
      const double offset = offset_mm(rectified, geometry, column);
      double sum = 0;
      for (const ColumnSample& sample : samples_of(samples, column)) sum += sample.weight;
      // A hundred weights rounded to 32-bit floats.
      EXPECT_NEAR(sum, offset < 100 ? 2 * std::sqrt((100 - offset) * (100 + offset)) : 0, 1e-4) << column;
    }
  }
}

/// The map under an outline with half axes of 100 mm to the sides and 60 mm to the front.
MapGeometry under_ellipse(const MapGeometry& circles) {
  std::vector<float> outline_mm;
  for (int i = 0; i < circles.width; ++i) {
    const double phi = circles.phi_rad(i);
    outline_mm.push_back(static_cast<float>(1 / std::hypot(std::sin(phi) / 100, std::cos(phi) / 60)));
  }
  return with_outline(circles, outline_mm);
}

TEST(ColumnSamples, UnderAnEllipseAddUpToItsChords) {
  const MapGeometry geometry = under_ellipse(map({0, 30, 50, 100}, {0, 0}));
  const RectifiedView rectified = view_of_map(geometry, {}, 0);
  const ColumnSamples samples = column_samples(rectified, geometry, {});
  for (int column = 0; column < rectified.columns; ++column) {
    const double share = rectified.origin_mm(column).x / 100;
    double sum = 0;
    for (const ColumnSample& sample : samples_of(samples, column)) sum += sample.weight;
    // R is linear between columns a degree apart, and 32-bit: up to 0.005 mm too small, more of a chord that
    // grazes.
    EXPECT_NEAR(sum, std::abs(share) < 1 ? 120 * std::sqrt(1 - share * share) : 0,
                std::abs(share) > 0.95 ? 0.3 : 0.03)
        << column;
  }
}

TEST(ColumnSamples, UnderAnOutlineHaveWallsWhereItStands) {
  const MapGeometry geometry = under_ellipse(map({0, 50, 100}, {0, 0}));
  const RectifiedView rectified = view_of_map(geometry, {}, 0);
  const ColumnSamples samples = column_samples(rectified, geometry, {.compositing = Compositing::wall});
  for (int column = 0; column < rectified.columns; ++column) {
    const double x = std::abs(rectified.origin_mm(column).x);
    EXPECT_EQ(samples_of(samples, column).size(), x < 49.9 ? 4u
                                                  : x > 50.1 && x < 99.8
                                                      ? 2u
                                                      : samples_of(samples, column).size());
  }
}

TEST(ColumnSamples, EndWhereTheScanDoes) {
  MapGeometry geometry = map({0, 30, 50, 100}, {0, 0});
  geometry.field = FieldOfView{{-60, -200, 0}, {40, 70, 100}};
  View view{.centre_mm = {0, 0, 6}};
  const RectifiedView rectified = rectified_view(fitted(view, bounds_of(geometry)), geometry);
  const ColumnSamples samples = column_samples(rectified, geometry, {});
  for (int column = 0; column < rectified.columns; ++column) {
    // Rays along y at this x: within the circle, and up to y = 70 of the scan.
    const double x = rectified.origin_mm(column).x,
                 half_chord = std::sqrt(std::max(0.0, (100 - x) * (100 + x)));
    double sum = 0;
    for (const ColumnSample& sample : samples_of(samples, column)) sum += sample.weight;
    // A hundred weights rounded to 32-bit floats.
    EXPECT_NEAR(sum, x < -60 || x > 40 ? 0 : half_chord + std::min(half_chord, 70.0), 1e-4) << x;
  }
}

/// A map that is the same in all rows, drawn: one optical depth a column.
std::vector<double> drawn(const ColumnSamples& samples, const MapGeometry& geometry,
                          const std::vector<double>& texels) {
  std::vector<double> tau;
  for (std::size_t column = 0; column < samples.columns.size(); ++column) {
    double sum = 0;
    for (const ColumnSample& s : samples_of(samples, static_cast<int>(column))) {
      const auto at = static_cast<int>(s.texel), width = geometry.width + 1;
      const auto between = [&](int layer) {
        const int texel = at % width;
        return texels[layer * geometry.width + texel % geometry.width] * (1 - s.column_fraction) +
               texels[layer * geometry.width + (texel + 1) % geometry.width] * s.column_fraction;
      };
      const int layer = at / width;
      sum += s.weight * (between(layer) * (1 - s.layer_fraction) +
                         (s.layer_fraction > 0 ? between(layer + 1) * s.layer_fraction : 0));
    }
    tau.push_back(sum);
  }
  return tau;
}

TEST(ColumnSamples, UnderAConstantOutlineShowWhatTheyShowUnderItsCircle) {
  const MapGeometry circles = map({0, 30, 50, 70, 100});
  const MapGeometry same =
      with_outline(circles, std::vector<float>(static_cast<std::size_t>(circles.width), 100));
  std::vector<double> texels;
  for (int k = 0; k < circles.layers(); ++k)
    for (int i = 0; i < circles.width; ++i)
      texels.push_back(0.01 * (k + 1) + 0.01 * std::sin(3 * circles.phi_rad(i) + k));
  const RectifiedView rectified = view_of_map(circles, Cone{600, 900});
  const std::vector<double> a = drawn(column_samples(rectified, circles, {}), circles, texels),
                            b = drawn(column_samples(rectified, same, {}), same, texels);
  ASSERT_EQ(a.size(), b.size());
  // Circles' pieces also end where the line is nearest to the axis, which changes the quadrature; depths are
  // up to 6.
  for (std::size_t column = 0; column < a.size(); ++column) EXPECT_NEAR(a[column], b[column], 2e-3) << column;
}

TEST(ColumnSamples, IntegrateAMapThatVariesWithRadiusAndAngle) {
  const MapGeometry geometry = map({0, 30, 50, 70, 100});
  const RadialProfile profile(geometry.radii_mm, Reconstruction::linear);
  std::vector<double> texels;
  for (int k = 0; k < geometry.layers(); ++k)
    for (int i = 0; i < geometry.width; ++i)
      texels.push_back(0.01 * (k + 1) + 0.01 * std::sin(3 * geometry.phi_rad(i) + k));
  const RectifiedView rectified = view_of_map(geometry, Cone{600, 900});
  const std::vector<double> tau = drawn(column_samples(rectified, geometry, {}), geometry, texels);
  for (int column = 0; column < rectified.columns; column += 7) {
    // The definition: mu at evenly spaced points of the ray, with the angle's sine instead of texels.
    double expected = 0;
    constexpr double kStep_mm = 0.01;
    const glm::dvec2 origin = rectified.origin_mm(column) - geometry.centre_mm[0];
    for (double s = -150; s < 150; s += kStep_mm) {
      const glm::dvec2 p = origin + s * rectified.direction(column);
      const double radius = glm::length(p);
      if (radius > 100) continue;
      const auto place = profile.at(radius);
      const double phi = std::atan2(p.x, -p.y);
      const auto mu = [&](int k) { return 0.01 * (k + 1) + 0.01 * std::sin(3 * phi + k); };
      expected += kStep_mm * (mu(place.layer) * (1 - place.fraction) + mu(place.layer + 1) * place.fraction);
    }
    // Texels of a degree show a sine of three periods to (3 deg)^2 / 8 = 3e-4 of its amplitude, which adds
    // up to 6e-4 over 200 mm. Ways h of up to 1.5 texels, 1.3 mm at a radius of 50 mm, that are taken by
    // their middle miss h^2 / 24 of the second derivative: 5e-4 of the sine's own, and 1.7e-3 of what it
    // gains by the share of the next layer changing with it; where a texel ends within, as much of the former
    // again.
    EXPECT_NEAR(tau[column], expected, 3.5e-3) << column;
  }
}

TEST(ColumnSamples, GoFromFarToNear) {
  const MapGeometry geometry = map({0, 30, 50, 100});
  for (const Compositing compositing : {Compositing::wall, Compositing::path}) {
    const RectifiedView rectified = view_of_map(geometry);
    SampleOptions options;
    options.compositing = compositing;
    const ColumnSamples all = column_samples(rectified, geometry, options);
    for (int column = 0; column < rectified.columns; ++column)
      EXPECT_TRUE(std::ranges::is_sorted(samples_of(all, column), {}, &ColumnSample::s_mm)) << column;
  }
}

TEST(ColumnSamples, WallsStandWhereTheyAreCrossed) {
  const MapGeometry geometry = map({0, 40, 80}, {10, -5});
  const RectifiedView rectified = view_of_map(geometry, {}, 0);
  SampleOptions options{.compositing = Compositing::wall};
  options.wall_radius_mm = 100;  // moves both out
  const ColumnSamples all = column_samples(rectified, geometry, options);
  for (int column = 0; column < rectified.columns; ++column) {
    const double offset = offset_mm(rectified, geometry, column);
    const auto samples = samples_of(all, column);
    ASSERT_EQ(samples.size(), offset < 50 ? 4u : offset < 100 ? 2u : 0u);
    if (samples.empty()) continue;
    // Positions in millimetres as 32-bit floats.
    EXPECT_NEAR(samples.front().s_mm, -std::sqrt(100 * 100 - offset * offset), 1e-4);
    EXPECT_EQ(samples.front().weight, 1);
    EXPECT_EQ(static_cast<int>(samples.front().texel) / 361, 1);
    EXPECT_EQ(samples.front().from_mm, samples.front().to_mm);
  }
  EXPECT_FALSE(options.blends_layers(geometry));
}

TEST(ColumnSamples, RectanglesMixTheirNeighbours) {
  MapGeometry geometry = map({0, 50}, {10, -5});
  geometry.ray_layout = RayLayout::rectangle;
  geometry.views = 4;  // 0, 45, 90, 135 deg
  geometry.width = 100;
  const RectifiedView between = view_of_map(geometry, {}, 30);
  const ColumnSamples samples = column_samples(between, geometry, {});
  const auto middle = samples_of(samples, between.columns / 2);
  ASSERT_EQ(middle.size(), 2u);
  EXPECT_NEAR(middle[0].weight, 1 / 3.0, 1e-6);
  EXPECT_EQ(static_cast<int>(middle[0].texel) / 101, 0);
  EXPECT_EQ(static_cast<int>(middle[1].texel) / 101, 1);

  // From the other side it is the mirror image.
  const RectifiedView front = view_of_map(geometry, {}, 0), back = view_of_map(geometry, {}, 180);
  const ColumnSamples seen = column_samples(front, geometry, {}),
                      mirrored = column_samples(back, geometry, {});
  const auto place = [](const ColumnSample& s) { return s.texel + s.column_fraction; };
  EXPECT_NEAR(place(samples_of(seen, 20)[0]) + place(samples_of(mirrored, 20)[0]), 99, 1e-3);
  EXPECT_THROW(column_samples(view_of_map(geometry, Cone{600, 900}), geometry, {}), InputError);
}

}  // namespace
}  // namespace xraycast::column_samples_test
