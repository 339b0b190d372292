#include "xraycast/requests/body_fit.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/casting/outline_bands.hpp"

#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>

namespace xraycast::body_fit_test {
namespace {

constexpr double kSpacing_mm = 1.5;
using Inside = std::function<bool(const glm::dvec3&)>;

Volume make(const Inside& inside, std::int64_t slices = 30) {
  Volume volume({{200, 200, slices}, {kSpacing_mm, kSpacing_mm, 3}, {-149.25, -149.25, 0}});
  const VolumeGeometry& g = volume.geometry();
  for (std::int64_t z = 0; z < g.size.z; ++z)
    for (std::int64_t y = 0; y < g.size.y; ++y)
      for (std::int64_t x = 0; x < g.size.x; ++x)
        volume.at(x, y, z) = inside(g.to_world_mm({x, y, z})) ? 0 : -1000;
  return volume;
}

/// A trunk of 130 x 80 mm, which narrows to 60 % at its lower end.
bool in_trunk(const glm::dvec3& p) {
  const double width = 0.6 + 0.4 * p.z / 87;
  return std::hypot(p.x / (130 * width), (p.y + 10) / (80 * width)) < 1;
}
bool in_table(const glm::dvec3& p) { return p.y > 95 && p.y < 99 && std::abs(p.x) < 100; }

OutlineFinder seen(const Volume& volume, bool keeps_table = false) {
  OutlineFinder finder(volume.geometry(), {.finds_skin = true, .keeps_table = keeps_table});
  finder.add(volume.hu());
  return finder;
}

MapGeometry circles(const Volume& volume, const OutlineFinder& finder) {
  const BodyOutline body = finder.finish();
  return cylinder_map(volume.geometry(), 360, shell_radii_mm(RadiiRule::near_skin, 4, body.radius_mm),
                      body.centre_mm);
}

/// How far inside of the outline a place lies, as a length along its ray.
double depth_mm(const MapGeometry& map, const glm::dvec3& p) {
  const glm::dvec2 from = glm::dvec2(p) - map.centre_mm[0];
  const double column = std::atan2(from.x, -from.y) / (2 * std::numbers::pi) * map.width - 0.5;
  const double r = glm::length(from),
               shell = map.shell_radius_mm(r, column, (map.top_mm - p.z) / map.row_spacing_mm);
  return r * (map.radius_mm() / shell - 1);
}

TEST(BodyFit, EnclosesTheBodyAMillimetreOutsideOfItsSkin) {
  const Volume volume = make(in_trunk);
  const OutlineFinder finder = seen(volume);
  // A circle with room around the body: no outline lies beyond it.
  const MapGeometry map =
      fit_to_body(cylinder_map(volume.geometry(), 360, {0, 145}, finder.finish().centre_mm), finder);
  const VolumeGeometry& g = volume.geometry();
  double least = 1e9;
  for (std::int64_t z = 0; z < g.size.z; ++z)
    for (std::int64_t y = 0; y < g.size.y; ++y)
      for (std::int64_t x = 0; x < g.size.x; ++x)
        if (volume.at(x, y, z) == 0) least = std::min(least, depth_mm(map, g.to_world_mm({x, y, z})));
  EXPECT_GE(least, 1);
}

TEST(BodyFit, IsTightAndNowhereWiderThanTheCircle) {
  const Volume volume = make(in_trunk);
  const OutlineFinder finder = seen(volume);
  const MapGeometry circle = circles(volume, finder), map = fit_to_body(circle, finder);
  EXPECT_LE(map.radius_mm(), circle.radius_mm() + 1e-4);  // of a 32-bit float
  // The margin, half a voxel's diagonal, and what an ellipse gains within the five degrees over which the
  // outline is smooth.
  for (int column = 0; column < 360; ++column) {
    const double phi = map.phi_rad(column), a = std::sin(phi) / 130, b = std::cos(phi) / 80;
    const glm::dvec2 c = map.centre_mm[0];
    const double centre_moves = glm::length(c - glm::dvec2(0, -10));
    EXPECT_LE(map.outline_mm[static_cast<std::size_t>(column)], 1 / std::hypot(a, b) + centre_moves + 7)
        << column;
  }
}

TEST(BodyFit, LeavesTheTableOutUnlessItIsKept) {
  const Volume volume = make([](const glm::dvec3& p) { return in_trunk(p) || in_table(p); });
  const OutlineFinder without = seen(volume), with = seen(volume, true);
  const MapGeometry body = fit_to_body(circles(volume, without), without),
                    all = fit_to_body(circles(volume, with), with);
  const glm::dvec3 table(20, 97, 40);
  EXPECT_LT(depth_mm(body, table), 0);
  EXPECT_GT(depth_mm(all, table), 1);
}

TEST(BodyFit, IsPositiveWhereTheAxisLiesOutsideOfTheBody) {
  const Volume volume = make(in_trunk);
  const OutlineFinder finder = seen(volume);
  const MapGeometry map =
      fit_to_body(cylinder_map(volume.geometry(), 360, {0, 50, 250}, glm::dvec2(140, 0)), finder);
  EXPECT_GT(std::ranges::min(map.outline_mm), 0);
  EXPECT_LE(map.radius_mm(), 250);
}

/// A head above shoulders.
bool in_bust(const glm::dvec3& p) {
  return p.z > 120 ? std::hypot(p.x, p.y + 10) < 50 : std::hypot(p.x / 130, (p.y + 10) / 80) < 1;
}

TEST(BodyFit, HasAnOutlineOfItsOwnForBandsOfRowsThatDiffer) {
  const Volume volume = make(in_bust, 80);
  const OutlineFinder finder = seen(volume);
  const MapGeometry map =
      fit_to_body(cylinder_map(volume.geometry(), 360, {0, 145}, finder.finish().centre_mm), finder);
  const std::vector<OutlineBand> bands = outline_bands(map);
  ASSERT_GE(bands.size(), 2u);
  ASSERT_LE(bands.size(), static_cast<std::size_t>(kMostOutlineBands));
  const VolumeGeometry& g = volume.geometry();
  double least_mm = 1e9, widest_of_head_mm = 0;
  for (std::int64_t z = 0; z < g.size.z; ++z)
    for (std::int64_t y = 0; y < g.size.y; ++y)
      for (std::int64_t x = 0; x < g.size.x; ++x)
        if (volume.at(x, y, z) == 0) least_mm = std::min(least_mm, depth_mm(map, g.to_world_mm({x, y, z})));
  EXPECT_GE(least_mm, 1);
  for (int column = 0; column < map.width; ++column)
    widest_of_head_mm = std::max(widest_of_head_mm, map.radius_mm() * map.scale(column, 0));
  // The head's 50 mm, the axis off its middle by what the shoulders' centroid moves it, margin and voxel.
  EXPECT_LE(widest_of_head_mm, 50 + glm::length(map.centre_mm[0] - glm::dvec2(0, -10)) + 7);
}

TEST(BodyFit, HasABandOfItsOwnForAWaist) {
  // Two bands alone would save nothing.
  const Volume volume = make(
      [](const glm::dvec3& p) {
        const double share = p.z > 144 && p.z < 336 ? 0.4 : 1.0;
        return std::hypot(p.x / 130, (p.y + 10) / 80) < share;
      },
      160);
  const OutlineFinder finder = seen(volume);
  EXPECT_GE(outline_bands(fit_to_body(circles(volume, finder), finder)).size(), 3u);
}

TEST(BodyFit, OfABodyThatIsAsWideEverywhereHasOneOutline) {
  const Volume volume = make([](const glm::dvec3& p) { return std::hypot(p.x / 130, (p.y + 10) / 80) < 1; });
  const OutlineFinder finder = seen(volume);
  EXPECT_TRUE(fit_to_body(circles(volume, finder), finder).has_plane_outline());
}

TEST(BodyFit, OfASphereEnclosesTheBodyInEveryDirection) {
  const Volume volume = make(in_trunk);
  const OutlineFinder finder = seen(volume);
  const glm::dvec3 centre(3, -8, 45);
  const MapGeometry map = fit_to_body(sphere_map(volume.geometry(), 180, {0, 80, 160}, centre), finder);
  ASSERT_FALSE(map.has_plane_outline());
  const VolumeGeometry& g = volume.geometry();
  double least = 1e9;
  for (std::int64_t z = 0; z < g.size.z; ++z)
    for (std::int64_t y = 0; y < g.size.y; ++y)
      for (std::int64_t x = 0; x < g.size.x; ++x) {
        const glm::dvec3 p = g.to_world_mm({x, y, z}) - centre;
        const double r = glm::length(p);
        if (volume.at(x, y, z) != 0 || r == 0) continue;
        const double column = std::atan2(p.x, -p.y) / (2 * std::numbers::pi) * map.width - 0.5,
                     row = std::acos(p.z / r) / std::numbers::pi * map.height - 0.5;
        least = std::min(least, r * (map.radius_mm() / map.shell_radius_mm(r, column, row) - 1));
      }
  EXPECT_GE(least, 1);
}

TEST(BodyFit, OfABodyThatTouchesTheFieldOnAllSidesIsTheField) {
  const Volume volume = make([](const glm::dvec3&) { return true; });
  const OutlineFinder finder = seen(volume);
  const MapGeometry map = fit_to_body(circles(volume, finder), finder);
  const double half_mm = 100 * kSpacing_mm;  // to the last voxels' faces, where the scan ends
  for (const glm::dvec3& border :
       {glm::dvec3(half_mm, 0, 40), glm::dvec3(-half_mm, 20, 40), glm::dvec3(60, half_mm, 0),
        glm::dvec3(0, -half_mm, 80),
        // The circle, which is found on a coarse grid, cuts a corner's last half voxel off.
        glm::dvec3(half_mm - 0.5 * kSpacing_mm, half_mm - 0.5 * kSpacing_mm, 40)}) {
    // A voxel's half diagonal and the margin, and what a corner gains within the five degrees of smoothing.
    EXPECT_GE(depth_mm(map, border), -1e-5);  // 32-bit floats, where the circle cuts the outline off
    EXPECT_LE(depth_mm(map, border), 12);
  }
}

TEST(BodyFit, WithNothingInTheCircleIsRefused) {
  const Volume volume = make(in_trunk);
  const OutlineFinder finder = seen(volume);
  EXPECT_THROW(fit_to_body(cylinder_map(volume.geometry(), 360, {0, 5}, glm::dvec2(140, 130)), finder),
               InputError);
}

}  // namespace
}  // namespace xraycast::body_fit_test
