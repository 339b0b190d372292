// Frames from textures of 16-bit floats and of bytes against those of 32-bit floats.
#include "xraycast/casting/caster.hpp"
#include "xraycast/drawing/headless_context.hpp"
#include "xraycast/drawing/renderer.hpp"
#include "xraycast/geometry/mesh.hpp"
#include "xraycast/phantom/phantom.hpp"
#include "xraycast/sampling/c_arm_pose.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace xraycast::map_precision_gl_test {
namespace {

/// A square across the y axis.
Surface plate(const glm::dvec3& centre_mm, double half_mm) {
  Surface surface;
  for (const auto& [x, z] : {std::pair(-1, -1), {1, -1}, {1, 1}, {-1, 1}})
    surface.mesh.points_mm.emplace_back(centre_mm + half_mm * glm::dvec3(x, 0, z));
  surface.mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  return surface;
}

class MapPrecisionTest : public testing::Test {
 protected:
  HeadlessContext context_;
  ComputeDevice device_;
  Progress progress_;

  ResidentScan head() {
    return upload(device_, generate(make_phantom("head", {.size = Index3{96, 96, 80}}), device_, progress_));
  }
};

/// RMS and largest difference of two pictures, as shares of the largest depth.
struct Difference {
  double rms, largest;
};

Difference difference(const std::vector<float>& a, const std::vector<float>& b) {
  double squares = 0, largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    squares += (a[i] - b[i]) * (a[i] - b[i]);
    largest = std::max(largest, std::abs(double(a[i]) - b[i]));
  }
  const double deepest = std::ranges::max(a);
  return {std::sqrt(squares / static_cast<double>(a.size())) / deepest, largest / deepest};
}

std::vector<MapGeometry> geometries(const VolumeGeometry& volume) {
  const auto radii_mm = shell_radii_mm(RadiiRule::equal_area, 8, 110);
  MapGeometry bent = cylinder_map(volume, 180, radii_mm, glm::dvec2(0));
  bent.centre_mm.assign(static_cast<std::size_t>(bent.height), glm::dvec2(0));
  return {cylinder_map(volume, 180, radii_mm, glm::dvec2(0)), bent,
          sphere_map(volume, 180, shell_radii_mm(RadiiRule::equal_area, 8, 140), glm::dvec3(0)),
          rectangle_map(volume, 12, 110, glm::dvec2(0))};
}

TEST_F(MapPrecisionTest, FramesFromHalvesAndBytesAreThoseFromFloats) {
  const ResidentScan scan = head();
  for (const MapGeometry& geometry : geometries(scan.geometry()))
    for (const Compositing compositing : {Compositing::path, Compositing::wall}) {
      if (geometry.ray_layout == RayLayout::rectangle && compositing == Compositing::wall) continue;
      auto map = std::make_shared<BodyMap>(cast(scan, geometry, Opacity::paper(), progress_).map);
      const BodyBounds bounds = bounds_of(geometry);
      const View view =
          fitted(View{.lao_rad = 0.5, .centre_mm = bounds.centre_mm, .width = 120, .height = 100}, bounds);
      Style style;
      style.sampling.compositing = compositing;
      Renderer renderer;
      const auto drawn = [&](MapPrecision precision) {
        auto stored = std::make_shared<BodyMap>(*map);
        stored->precision = precision;
        renderer.set_map(stored);
        return renderer.tau(view, style);
      };
      const auto floats = drawn(MapPrecision::float32), halves = drawn(MapPrecision::float16),
                 bytes = drawn(MapPrecision::byte);
      // Every value is off by 1/2048 of itself at most, and errors of many samples cancel.
      EXPECT_LT(difference(floats, halves).largest, 1.0 / 2048) << to_string(geometry.ray_layout);
      // Half a step of 1/255 of a layer's largest value, which exceeds the means along rays a few times. A
      // wall or a stored picture is met once or twice, where errors do not cancel.
      EXPECT_LT(difference(floats, bytes).rms, 0.003) << to_string(geometry.ray_layout);
      EXPECT_LT(difference(floats, bytes).largest, 0.015) << to_string(geometry.ray_layout);
    }
}

TEST_F(MapPrecisionTest, TexturesTakeTwoBytesOrOne) {
  const ResidentScan scan = head();
  auto map =
      std::make_shared<BodyMap>(cast(scan, geometries(scan.geometry())[0], Opacity::paper(), progress_).map);
  const View view = fitted(View{.width = 64, .height = 64}, bounds_of(map->geometry));
  Renderer renderer;
  const auto size_B = [&](MapPrecision precision) {
    auto stored = std::make_shared<BodyMap>(*map);
    stored->precision = precision;
    renderer.set_map(stored);
    renderer.tau(view, {});
    return renderer.texture_B();
  };
  const std::size_t floats_B = size_B(MapPrecision::float32);
  EXPECT_EQ(size_B(MapPrecision::float16), floats_B / 2);
  // And the ranges of sixteen halves of shells, four 32-bit floats each.
  EXPECT_EQ(size_B(MapPrecision::byte), floats_B / 4 + 16 * 16);
  EXPECT_EQ(size_B(MapPrecision::float32), floats_B);
}

TEST_F(MapPrecisionTest, WhatLiesInFrontOfASurfaceIsDrawnFromBytesToo) {
  const ResidentScan scan = head();
  for (const MapGeometry& geometry : geometries(scan.geometry())) {
    if (geometry.ray_layout == RayLayout::rectangle) continue;
    auto map = std::make_shared<BodyMap>(cast(scan, geometry, Opacity::paper(), progress_).map);
    auto bytes = std::make_shared<BodyMap>(*map);
    bytes->precision = MapPrecision::byte;
    const BodyBounds bounds = bounds_of(geometry);
    const View view =
        fitted(View{.lao_rad = 0.3, .centre_mm = bounds.centre_mm, .width = 80, .height = 80}, bounds);
    Style style;
    style.look = Look::surface;
    Renderer renderer;
    renderer.set_surfaces(std::vector<Surface>{plate(bounds.centre_mm, 40)});
    renderer.set_map(map);
    const auto from_floats = renderer.tau(view, style);
    renderer.set_map(bytes);
    // As above; half of a ray has fewer samples, among which errors cancel less.
    EXPECT_LT(difference(from_floats, renderer.tau(view, style)).rms, 0.005)
        << to_string(geometry.ray_layout);
  }
}

}  // namespace
}  // namespace xraycast::map_precision_gl_test
