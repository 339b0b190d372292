#include "xraycast/phantom/phantom.hpp"
#include "xraycast/phantom/phantom_bodies.hpp"
#include "xraycast/phantom/phantom_tissue.hpp"

#include <cmath>
#include <numbers>

namespace xraycast {
namespace {

constexpr double kWater_hu = 0;

double density_hu(double density) { return 1024 * (density - 1); }

}  // namespace

PhantomBody make_cylinder() {
  constexpr double kRadius_mm = 80, kFarBeyond_mm = 1e4;
  PhantomScene scene(kAir_hu);
  scene.paint(kWater_hu);
  scene.capsule({{0, 0, -kFarBeyond_mm}, kRadius_mm}, {{0, 0, kFarBeyond_mm}, kRadius_mm});
  return {std::move(scene)};
}

PhantomBody make_sphere() {
  PhantomScene scene(kAir_hu);
  scene.paint(kWater_hu);
  scene.ellipsoid({0, 0, 0}, {80, 80, 80});
  return {std::move(scene)};
}

PhantomBody make_box() {
  PhantomScene scene(kAir_hu);
  scene.paint(kWater_hu);
  scene.box({0, 0, 0}, {80, 60, 70});
  return {std::move(scene)};
}

std::vector<Ellipsoid> shepp_logan_ellipsoids() {
  // Centre, half axes (both of a cube from -1 to 1), turn in degrees, density.
  constexpr double kTable[][8] = {
      {0, 0, 0, 0.69, 0.92, 0.9, 0, 2},
      {0, 0, 0, 0.6624, 0.874, 0.88, 0, -0.98},
      {-0.22, 0, -0.25, 0.41, 0.16, 0.21, 108, -0.02},
      {0.22, 0, -0.25, 0.31, 0.11, 0.22, 72, -0.02},
      {0, 0.35, -0.25, 0.21, 0.25, 0.5, 0, 0.02},
      {0, 0.1, -0.25, 0.046, 0.046, 0.046, 0, 0.02},
      {-0.08, -0.65, -0.25, 0.046, 0.023, 0.02, 0, 0.01},
      {0.06, -0.65, -0.25, 0.046, 0.023, 0.02, 90, 0.01},
      {0.06, -0.105, 0.625, 0.056, 0.04, 0.1, 90, 0.02},
      {0, 0.1, 0.625, 0.056, 0.056, 0.1, 0, -0.02},
  };
  constexpr double kHalfCube_mm = 128, kRadians = std::numbers::pi / 180;
  std::vector<Ellipsoid> ellipsoids;
  for (const auto& [x, y, z, a, b, c, turn, density] : kTable)
    ellipsoids.push_back(
        {kHalfCube_mm * glm::dvec3(x, y, z), kHalfCube_mm * glm::dvec3(a, b, c), turn * kRadians, density});
  return ellipsoids;
}

PhantomBody make_shepp_logan() {
  PhantomScene scene(density_hu(0));
  for (const Ellipsoid& e : shepp_logan_ellipsoids()) {
    const double c = std::cos(e.turn_rad), s = std::sin(e.turn_rad);
    scene.add(density_hu(e.density) - density_hu(0));
    scene.ellipsoid(e.centre_mm, e.half_axes_mm, {{c, s, 0}, {-s, c, 0}});
  }
  return {std::move(scene)};
}

}  // namespace xraycast
