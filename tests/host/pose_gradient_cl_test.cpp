#include "support/reference.hpp"
#include "support/shared_device.hpp"
#include "xraycast/projection/projector.hpp"

#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numbers>
#include <vector>

namespace xraycast::test::pose_gradient_cl_test {
namespace {

constexpr double kRadians = std::numbers::pi / 180;

struct Ray {
  glm::dvec3 start_mm, end_mm;
};

/// What a rigid motion makes of a point: a translation, or a rotation about `centre_mm`, along one axis.
glm::dvec3 moved(const glm::dvec3& point_mm, int component, double amount, const glm::dvec3& centre_mm) {
  glm::dvec3 axis(0);
  axis[component % 3] = 1;
  if (component < 3) return point_mm + amount * axis;
  const glm::dvec3 arm = point_mm - centre_mm;
  return centre_mm + arm * std::cos(amount) + glm::cross(axis, arm) * std::sin(amount) +
         axis * glm::dot(axis, arm) * (1 - std::cos(amount));
}

using Derivatives = std::array<double, 6>;

/// Six derivatives of Joseph's sum along a ray, by central differences in double precision.
Derivatives central_differences(const Volume& volume, const Ray& ray, const MuOfHu& mu, double step_mm) {
  const VolumeGeometry& grid = volume.geometry();
  const glm::dvec3 centre_mm = 0.5 * (grid.lower_mm() + grid.upper_mm());
  Derivatives derivatives{};
  for (int component = 0; component < 6; ++component) {
    const double step =
        component < 3 ? step_mm : 0.01 * step_mm;  // a radian moves what is 100 mm away by as much
    const auto tau = [&](double amount) {
      return reference_joseph(volume, moved(ray.start_mm, component, amount, centre_mm),
                              moved(ray.end_mm, component, amount, centre_mm), mu);
    };
    derivatives[static_cast<std::size_t>(component)] = (tau(step) - tau(-step)) / (2 * step);
  }
  return derivatives;
}

/// Compares a picture's gradient with central differences along `ray_of(i, j)`: every component within a
/// thousandth of its largest value. A pixel is left out where a sample lies so near to a voxel's edge, at
/// which the sum has two derivatives, that steps of the size of the kernel's rounding cross it.
void expect_gradient(const PoseGradient& found, int width, int height, const Volume& volume,
                     const Opacity& opacity, const std::function<Ray(int i, int j)>& ray_of) {
  const auto mu = [&](double hu) { return opacity.mu_per_mm(hu); };
  constexpr double kFine_mm = 1e-6, kRounding_mm = 2e-4;
  std::vector<Derivatives> expected, coarse;
  Derivatives largest{};
  for (int j = 0; j < height; ++j)
    for (int i = 0; i < width; ++i) {
      expected.push_back(central_differences(volume, ray_of(i, j), mu, kFine_mm));
      coarse.push_back(central_differences(volume, ray_of(i, j), mu, kRounding_mm));
      for (std::size_t n = 0; n < 6; ++n) largest[n] = std::max(largest[n], std::abs(expected.back()[n]));
    }
  std::size_t left_out = 0;
  Derivatives worst{};
  for (std::size_t pixel = 0; pixel < expected.size(); ++pixel) {
    const auto is_on_edge = [&](std::size_t n) {
      return std::abs(expected[pixel][n] - coarse[pixel][n]) > 1e-4 * largest[n];
    };
    if (is_on_edge(0) || is_on_edge(1) || is_on_edge(2) || is_on_edge(3) || is_on_edge(4) || is_on_edge(5)) {
      ++left_out;
      continue;
    }
    for (std::size_t n = 0; n < 6; ++n)
      worst[n] = std::max(worst[n], std::abs(found.gradient[6 * pixel + n] - expected[pixel][n]));
  }
  for (std::size_t n = 0; n < 6; ++n) {
    EXPECT_GT(largest[n], 0) << n;
    EXPECT_LT(worst[n], 1e-3 * largest[n]) << "component " << n << ", largest " << largest[n];
  }
  // Some forty samples a ray, of two coordinates, come as near to an edge with a probability of a few 1e-4.
  EXPECT_LT(left_out, expected.size() / 20);
}

/// Off the volume's middle, so that no ray lies on the edges of voxels.
constexpr glm::dvec3 kCentre_mm{1.37, -2.21, 3.73};

View view_from(double angle_deg, double tilt_deg, const std::optional<Cone>& cone) {
  return {.lao_rad = angle_deg * kRadians,
          .cranial_rad = tilt_deg * kRadians,
          .cone = cone,
          .centre_mm = kCentre_mm,
          .width = 24,
          .height = 20,
          .pixel_mm = 3.1};
}

Ray ray_of(const View& view, int i, int j) {
  const glm::dvec3 pixel_mm = view.pixel_on_detector_mm(i, j);
  if (view.cone) return {view.source_mm(), pixel_mm};
  return {pixel_mm - 2000.0 * view.towards_detector(), pixel_mm + 2000.0 * view.towards_detector()};
}

void expect_gradient(const View& view, const Volume& volume, const Opacity& opacity, ScanStorage storage) {
  Progress progress;
  const ResidentScan scan = upload(device(), volume, storage);
  expect_gradient(project_with_gradient(scan, view, opacity, progress), view.width, view.height, volume,
                  opacity, [&](int i, int j) { return ray_of(view, i, j); });
}

Volume volume() { return textured_volume({40, 36, 44}, {1.6, 1.7, 1.9}); }

TEST(PoseGradient, IsThatOfCentralDifferencesFromAllSides) {
  for (const auto& [angle_deg, tilt_deg] : std::vector<std::pair<double, double>>{
           {7, 3}, {77, -12}, {200, 41}, {33, 71}, {-120, -83}})  // dominated by y, x and z
    expect_gradient(view_from(angle_deg, tilt_deg, Cone{400, 700}), volume(), Opacity::paper(),
                    ScanStorage::bricks);
}

TEST(PoseGradient, IsThatOfParallelBeams) {
  expect_gradient(view_from(23, 11, {}), volume(), Opacity::paper(), ScanStorage::bricks);
}

TEST(PoseGradient, FollowsOpacitiesWithKnots) {
  // Few ramps, and a table.
  expect_gradient(view_from(23, 11, Cone{400, 700}), volume(), Opacity::bilinear(), ScanStorage::bricks);
  const Opacity table(
      "table",
      {{-1000, 0.001}, {-500, 0.004}, {-100, 0.018}, {40, 0.02}, {300, 0.05}, {900, 0.03}, {2000, 0.07}});
  expect_gradient(view_from(23, 11, Cone{400, 700}), volume(), table, ScanStorage::bricks);
}

TEST(PoseGradient, KnowsASourceAndADetectorWithinTheScan) {
  expect_gradient(view_from(23, 11, Cone{20, 41}), volume(), Opacity::paper(), ScanStorage::bricks);
}

TEST(PoseGradient, IsTheSameFromImages) {
  if (device().info().has_images)
    expect_gradient(view_from(23, 11, Cone{400, 700}), volume(), Opacity::paper(), ScanStorage::image);
  else
    GTEST_SKIP() << "the device has no images";
}

TEST(PoseGradient, IsThatOfCameras) {
  const View view = view_from(23, 11, Cone{400, 700});
  const PinholeCamera camera = camera_of(view);
  Progress progress;
  const Volume scanned = volume();
  const ResidentScan scan = upload(device(), scanned, ScanStorage::bricks);
  expect_gradient(project_with_gradient(scan, camera, Opacity::paper(), progress), view.width, view.height,
                  scanned, Opacity::paper(), [&](int i, int j) {
                    return Ray{camera.source_mm(), camera.source_mm() + 900.0 * camera.ray_mm(i, j)};
                  });
}

TEST(PoseGradient, ComesWithThePicture) {
  const View view = view_from(23, 11, Cone{400, 700});
  Progress progress;
  const Volume scanned = volume();
  const ResidentScan scan = upload(device(), scanned, ScanStorage::bricks);
  const std::vector<float> picture = project(scan, view, Opacity::paper(), progress).tau;
  const PoseGradient found = project_with_gradient(scan, view, Opacity::paper(), progress);
  // Sums of some fifty samples in 32 bits, in another order.
  for (std::size_t i = 0; i < picture.size(); ++i)
    EXPECT_NEAR(found.tau[i], picture[i], 2e-5 * (1 + picture[i]));
}

}  // namespace
}  // namespace xraycast::test::pose_gradient_cl_test
