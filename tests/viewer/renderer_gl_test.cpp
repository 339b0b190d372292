// Frames under whatever OpenGL there is without a display, which on most machines is software.
#include "xraycast/base/error.hpp"
#include "xraycast/base/stopwatch.hpp"
#include "xraycast/casting/caster.hpp"
#include "xraycast/drawing/brightness.hpp"
#include "xraycast/drawing/headless_context.hpp"
#include "xraycast/drawing/renderer.hpp"
#include "xraycast/phantom/phantom.hpp"
#include "xraycast/projection/projector.hpp"
#include "xraycast/requests/rays_within.hpp"
#include "xraycast/sampling/c_arm_pose.hpp"
#include "xraycast/scene/moving_surface.hpp"

#include <fmt/format.h>
#include <glm/geometric.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <tuple>

namespace xraycast::renderer_gl_test {
namespace {

constexpr double kRadians = std::numbers::pi / 180;

struct StoredFrame {
  Compositing compositing;
  Look look;
  std::array<int, 64> pixels;
};
const StoredFrame kStoredFrames[] = {
    {Compositing::path, Look::fluoro, {123, 123, 78, 78, 59, 59, 49, 49, 42, 42, 38, 38, 36, 36, 35, 35,
                                       30,  30,  22, 22, 18, 18, 15, 15, 13, 13, 16, 16, 29, 29, 75, 75,
                                       123, 123, 78, 78, 59, 59, 49, 49, 42, 42, 38, 38, 18, 18, 13, 13,
                                       11,  11,  11, 11, 18, 18, 15, 15, 13, 13, 16, 16, 29, 29, 75, 75}},
    {Compositing::path, Look::surface, {123, 123, 78, 78, 59, 59, 49, 49, 42, 42, 38, 38, 36, 36, 35, 35,
                                        30,  30,  22, 22, 18, 18, 15, 15, 13, 13, 16, 16, 29, 29, 75, 75,
                                        123, 123, 78, 78, 59, 59, 49, 49, 42, 42, 38, 38, 68, 8,  93, 12,
                                        93,  12,  56, 7,  18, 18, 15, 15, 13, 13, 16, 16, 29, 29, 75, 75}},
    {Compositing::wall, Look::fluoro, {94, 94, 94, 94, 94, 94, 94, 94, 35, 35, 35, 35, 35, 35, 35, 35,
                                       35, 35, 35, 35, 13, 13, 13, 13, 94, 94, 35, 35, 35, 35, 35, 35,
                                       94, 94, 94, 94, 94, 94, 94, 94, 35, 35, 35, 35, 18, 18, 13, 13,
                                       13, 13, 18, 18, 13, 13, 13, 13, 94, 94, 35, 35, 35, 35, 35, 35}},
    {Compositing::wall, Look::surface, {94, 94, 94, 94, 94, 94, 94, 94, 35, 35, 35, 35, 35, 35, 35, 35,
                                        35, 35, 35, 35, 13, 13, 13, 13, 94, 94, 35, 35, 35, 35, 35, 35,
                                        94, 94, 94, 94, 94, 94, 94, 94, 35, 35, 35, 35, 56, 7,  73, 9,
                                        73, 9,  56, 7,  13, 13, 13, 13, 94, 94, 35, 35, 35, 35, 35, 35}},
};

class RendererTest : public testing::Test {
 protected:
  HeadlessContext context_;
};

/// Two layers of mu 0.01/mm, 50 mm each, about an axis away from the origin.
std::shared_ptr<BodyMap> homogeneous(int layers = 2) {
  auto map = std::make_shared<BodyMap>();
  map->geometry.height = 101;
  map->geometry.centre_mm = {{20, -30}};
  map->geometry.top_mm = 50;
  map->geometry.radii_mm = shell_radii_mm(RadiiRule::equal_thickness, layers, 100);
  for (int k = 0; k < layers; ++k)
    map->tau.insert(map->tau.end(), map->layer_size(), static_cast<float>(0.01 * 100 / layers));
  return map;
}

View view_of_map(const BodyMap& map, double angle_deg, double tilt_deg = 0, std::optional<Cone> cone = {}) {
  View view{.lao_rad = angle_deg * kRadians, .cranial_rad = tilt_deg * kRadians, .cone = cone};
  view.centre_mm = bounds_of(map.geometry).centre_mm;
  view.width = 161;
  view.height = 120;
  return fitted(view, bounds_of(map.geometry));
}

/// Length in mm of a pixel's ray within the map's cylinder.
double chord_mm(const View& view, const MapGeometry& geometry, int i, int j) {
  const glm::dvec3 pixel = view.pixel_on_detector_mm(i, j);
  const glm::dvec3 along = view.cone ? glm::normalize(pixel - view.source_mm()) : view.towards_detector();
  const glm::dvec2 from = glm::dvec2(pixel) - geometry.centre_mm[0], xy(along);
  const double a = glm::dot(xy, xy), b = glm::dot(from, xy),
               c = glm::dot(from, from) - geometry.radius_mm() * geometry.radius_mm();
  if (b * b < a * c) return 0;
  double low = (-b - std::sqrt(b * b - a * c)) / a, high = (-b + std::sqrt(b * b - a * c)) / a;
  const double top = geometry.z_mm(-0.5) - pixel.z, bottom = geometry.z_mm(geometry.height - 0.5) - pixel.z;
  if (along.z != 0) {
    low = std::max(low, std::min(top / along.z, bottom / along.z));
    high = std::min(high, std::max(top / along.z, bottom / along.z));
  } else if (top < 0 || bottom > 0) {
    return 0;
  }
  return std::max(0.0, high - low);
}

class HomogeneousViews : public RendererTest,
                         public testing::WithParamInterface<std::pair<double, std::optional<Cone>>> {};

TEST_P(HomogeneousViews, AreTheLengthsOfRays) {
  const auto map = homogeneous(3);
  Renderer renderer;
  renderer.set_map(map);
  const auto [tilt_deg, cone] = GetParam();
  for (const double angle_deg : {0.0, 77.0}) {
    const View view = view_of_map(*map, angle_deg, tilt_deg, cone);
    const std::vector<float> tau = renderer.tau(view, {});
    double error = 0;
    for (int j = 0; j < view.height; ++j)
      for (int i = 0; i < view.width; ++i)
        error += std::abs(tau[j * view.width + i] - 0.01 * chord_mm(view, map->geometry, i, j));
    // Within the body 32-bit sums are good to 1e-6. At its ends a ray's last sample counts whole or not at
    // all, which is up to 4 mm in some rows, and at its sides columns are blended.
    const bool is_level = tilt_deg == 0 && !cone;
    EXPECT_LT(error / static_cast<double>(tau.size()), is_level ? 1e-6 : 8e-3) << angle_deg;
    const int middle = (view.height / 2) * view.width + view.width / 2;
    // The middle ray meets neither end. Between columns half a pixel off the axis the chord is shorter by
    // (1 mm)^2 / 2 / 100 mm.
    EXPECT_NEAR(tau[middle], 0.01 * chord_mm(view, map->geometry, view.width / 2, view.height / 2), 2e-4);
  }
}

INSTANTIATE_TEST_SUITE_P(Views, HomogeneousViews,
                         testing::Values(std::pair(0.0, std::optional<Cone>()),
                                         std::pair(20.0, std::optional<Cone>()),
                                         std::pair(0.0, std::optional<Cone>(Cone{1000, 1500})),
                                         std::pair(-15.0, std::optional<Cone>(Cone{700, 1100}))));

TEST_F(RendererTest, WallsCountTwiceWithTheirTexel) {
  const auto map = homogeneous(2);
  Renderer renderer;
  renderer.set_map(map);
  Style style;
  style.sampling.compositing = Compositing::wall;
  const View view = view_of_map(*map, 10);
  const std::vector<float> tau = renderer.tau(view, style);
  const float* row = &tau[60 * view.width];
  // Each wall holds 0.5; the axis is in the middle of pixel 80, the inner wall 50 mm beside it. Sums of
  // floats.
  EXPECT_NEAR(row[80], 2.0, 1e-6);
  EXPECT_NEAR(row[80 + static_cast<int>(60 / view.pixel_mm)], 1.0, 1e-6);
}

TEST_F(RendererTest, StrengthsHideAndWeakenLayers) {
  const auto map = homogeneous(2);
  Renderer renderer;
  renderer.set_map(map);
  Style style;
  style.sampling.reconstruction = Reconstruction::constant;
  style.layer_weights = {0, 0.5f};
  const View view = view_of_map(*map, 0);
  // 50 mm of the outer shell on each side at half of 0.01/mm.
  EXPECT_NEAR(renderer.tau(view, style)[60 * view.width + 80], 0.5, 1e-5);
}

/// A ball, closed and with normals outwards.
Mesh ball(const glm::dvec3& centre_mm, double radius_mm) {
  Mesh mesh;
  constexpr int kRings = 24, kSides = 48;
  for (int j = 0; j <= kRings; ++j)
    for (int i = 0; i < kSides; ++i) {
      const double theta = std::numbers::pi * j / kRings, phi = 2 * std::numbers::pi * i / kSides;
      mesh.points_mm.emplace_back(centre_mm + radius_mm * glm::dvec3(std::sin(theta) * std::cos(phi),
                                                                     std::sin(theta) * std::sin(phi),
                                                                     std::cos(theta)));
    }
  for (std::uint32_t j = 0; j < kRings; ++j)
    for (std::uint32_t i = 0; i < kSides; ++i) {
      const std::uint32_t a = j * kSides + i, b = j * kSides + (i + 1) % kSides, c = a + kSides,
                          d = b + kSides;
      mesh.triangles.push_back({a, c, b});
      mesh.triangles.push_back({b, c, d});
    }
  return mesh;
}

TEST_F(RendererTest, BallAbsorbsByItsThickness) {
  Renderer renderer;
  const auto map = homogeneous(1);
  const glm::dvec3 centre = bounds_of(map->geometry).centre_mm;
  renderer.set_surfaces(std::vector<Surface>{{ball(centre, 20), 0.05, {}}});
  for (const auto& cone : {std::optional<Cone>(), std::optional<Cone>(Cone{1000, 1500})}) {
    const View view = view_of_map(*map, 25, 10, cone);
    const std::vector<float> tau = renderer.tau(view, {});
    // Facets of 7.5 deg lie up to 20 mm * (1 - cos 3.75 deg) = 0.04 mm inside the sphere, on both sides.
    EXPECT_NEAR(tau[60 * view.width + 80], 0.05 * 40, 0.05 * 0.2);
    EXPECT_EQ(tau[0], 0);
  }
}

TEST_F(RendererTest, FullContrastShowsHowMuchTheBeamIsWeakened) {
  Renderer renderer;
  const auto map = homogeneous(1);
  const glm::dvec3 centre = bounds_of(map->geometry).centre_mm;
  const View view = view_of_map(*map, 25);
  const std::size_t middle = 60 * view.width + 80;
  Style style;
  style.window = {8, 0, 1};
  const auto grey = [&] { return renderer.picture(view, style)[3 * middle]; };
  renderer.set_map(map);
  const int body = grey();
  renderer.set_surfaces(std::vector<Surface>{{ball(centre, 2), 0.1, {}}});
  const double weakened =
      std::exp(-(renderer.tau(view, style)[middle] - renderer.body_tau(view, style)[middle]));
  // Both greys are rounded.
  EXPECT_NEAR(grey(), body * std::pow(weakened, 1 / style.window.scale), 1);
  style.full_contrast = true;
  EXPECT_NEAR(grey(), body * weakened, 1);
  EXPECT_LT(weakened, 0.7);
}

/// How much of the body lies in front of a surface whose middle is `ahead_mm` towards the detector.
float in_front(Renderer& renderer, const BodyMap& map, const View& view, double ahead_mm,
               const Style& style) {
  const glm::dvec3 centre = bounds_of(map.geometry).centre_mm + ahead_mm * view.towards_detector();
  renderer.set_surfaces(std::vector<Surface>{{ball(centre, 10), 0, {}}});
  return renderer.tau(view, style)[60 * view.width + 80];
}

TEST_F(RendererTest, OpaqueSurfacesHideWhatLiesBehindThem) {
  const auto map = homogeneous(2);
  Renderer renderer;
  renderer.set_map(map);
  Style style;
  style.look = Look::surface;
  for (const auto& cone : {std::optional<Cone>(), std::optional<Cone>(Cone{1000, 1500})})
    for (const double angle_deg : {0.0, 140.0}) {
      const View view = view_of_map(*map, angle_deg, 0, cone);
      // In front of everything, just within the near wall, inside a shell, at the axis, inside a far shell,
      // behind everything. A ball's front is 10 mm nearer than its middle.
      for (const double ahead : {120.0, 60.0, 25.0, 0.0, -45.0, -130.0}) {
        const double expected = 0.01 * std::clamp(100 - (ahead + 10), 0.0, 200.0);
        // The facets of the ball, as above, and a chord that is nearly the diameter.
        EXPECT_NEAR(in_front(renderer, *map, view, ahead, style), expected, 2e-3) << ahead;
      }
    }
}

TEST_F(RendererTest, SurfacesBesideTheBodyAreSeenWhole) {
  // A ball half within the body's outline and half beside it, its triangles also turned inside out.
  const auto map = homogeneous(1);
  Mesh mesh = ball(bounds_of(map->geometry).centre_mm + glm::dvec3(105, 0, 0), 20);
  View view = view_of_map(*map, 0);
  view.pixel_mm = 2;
  for (int turned = 0; turned < 2; ++turned) {
    Renderer renderer;
    renderer.set_map(map);
    renderer.set_surfaces(std::vector<Surface>{{mesh, 0.05, {1, 1, 1}}});
    Style style;
    style.look = Look::surface;
    const std::vector<std::uint8_t> picture = renderer.picture(view, style);
    // 94 and 114 mm from the axis: 11 mm left and 9 mm right of the ball's middle.
    const int row = 60 * view.width, within = row + 80 + 47, beside = row + 80 + 57;
    // Beside the body nothing darkens its light side; within, 34 mm of 0.01/mm before the ball do.
    EXPECT_GT(picture[3 * beside], 210) << turned;
    EXPECT_LT(picture[3 * within], 200) << turned;
    // 2 sqrt(20^2 - 9^2) mm, less what facets take away, as above.
    EXPECT_NEAR(renderer.tau(view, {})[beside], 0.05 * 35.7, 0.05 * 0.3) << turned;
    EXPECT_EQ(picture[3 * (row + view.width - 1)], 255) << turned;
    for (auto& triangle : mesh.triangles) std::swap(triangle[0], triangle[1]);
  }
}

TEST_F(RendererTest, SurfacesAreReplacedOneByOne) {
  const auto map = homogeneous(1);
  const glm::dvec3 centre = bounds_of(map->geometry).centre_mm;
  const View view = view_of_map(*map, 0);
  Renderer renderer;
  renderer.set_surfaces(std::vector<Surface>{{ball(centre, 20), 0.05, {}}, {ball(centre, 10), 0.01, {}}});
  renderer.replace_surface(1, {ball(centre + glm::dvec3(60, 0, 0), 10), 0.01, {}});
  const std::vector<float> tau = renderer.tau(view, {});
  // Facets, as above.
  EXPECT_NEAR(tau[60 * view.width + 80], 0.05 * 40, 0.01);
  EXPECT_NEAR(tau[60 * view.width + 80 + static_cast<int>(60 / view.pixel_mm)], 0.01 * 20, 0.002);
}

TEST_F(RendererTest, SurfacesMoveWithTheBody) {
  const auto map = homogeneous(1);
  const glm::dvec3 centre = bounds_of(map->geometry).centre_mm;
  const View view = view_of_map(*map, 0);
  const Surface rest{ball(centre, 20), 0.05, {1, 0, 0}},
      other{ball(centre + glm::dvec3(50, 0, 0), 10), 0.02, {0, 1, 0}};
  // A shear, which turns normals too.
  const Motion motion(
      {{"breath",
        4,
        {},
        {{0, nullptr}, {1, affine_displacement({1, 0, 0.5, 0, 1, 0, 0, 0, 1}, {0, 0, -15})}}}},
      "motion.json");
  Progress progress;
  MovingSurface moving(rest, motion, progress);
  const std::vector phases{0.7};
  const Surface& moved = moving.at(phases);
  Renderer moves, placed;
  moves.set_surfaces(std::vector{rest, other});
  moves.move_surface(0, moved.mesh.points_mm);
  placed.set_surfaces(std::vector{moved, other});
  Style shaded;
  shaded.look = Look::surface;
  EXPECT_EQ(moves.tau(view, {}), placed.tau(view, {}));
  EXPECT_EQ(moves.picture(view, shaded), placed.picture(view, shaded));
  placed.set_surfaces(std::vector{rest, other});
  EXPECT_NE(moves.picture(view, shaded), placed.picture(view, shaded));
  EXPECT_THROW(moves.move_surface(1, std::vector<glm::vec3>(1)), InputError);
}

TEST_F(RendererTest, NearerSurfacesHideFartherOnesAtEveryAngle) {
  // Red, green and blue balls in a row from front to back, drawn in all orders: what is nearest to the
  // detector is seen, under a cone too, whose source is on the other side.
  const glm::dvec3 centre(20, -30, 0), colours[] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  const auto map = homogeneous(1);
  Style style;
  style.look = Look::surface;
  for (std::array order : {std::array{0, 1, 2}, std::array{2, 1, 0}, std::array{1, 2, 0}}) {
    std::vector<Surface> balls;
    for (const int k : order)
      balls.push_back({ball(centre + glm::dvec3(0, 40 * (k - 1), 0), 12), 0, colours[k]});
    Renderer renderer;
    renderer.set_surfaces(balls);
    for (const auto& cone : {std::optional<Cone>(), std::optional<Cone>(Cone{1000, 1500})})
      for (const auto& [angle_deg, nearest] : {std::pair(0.0, 0), std::pair(180.0, 2)}) {
        const auto picture = renderer.picture(view_of_map(*map, angle_deg, 0, cone), style);
        const std::uint8_t* middle = &picture[3 * (60 * 161 + 80)];
        // Facets turn the normal by 4 deg at most, which leaves 0.998 of the light.
        for (int channel = 0; channel < 3; ++channel)
          EXPECT_NEAR(middle[channel], channel == nearest ? 255 : 0, 3) << angle_deg << ' ' << channel;
      }
  }
}

TEST_F(RendererTest, FramesLookAsTheyDid) {
  // A wedge of bone in a homogeneous body with a vessel through it, at every tenth pixel of a row above and
  // one through the vessel; red and blue, since the vessel has a colour. Made by this test itself, printed
  // when it fails, and looked at: the wedge darkens the right, the vessel is seen through what is before it.
  auto map = homogeneous(2);
  for (std::size_t i = 0; i < map->tau.size(); ++i)
    if (const double phi = map->geometry.phi_rad(static_cast<double>(i % 360)); phi > 1 && phi < 1.8)
      map->tau[i] = 1.5f;
  Renderer renderer;
  renderer.set_map(map);
  renderer.set_surfaces(
      std::vector<Surface>{{ball(bounds_of(map->geometry).centre_mm, 25), 0.02, {0.8, 0.2, 0.1}}});
  const View view = view_of_map(*map, 20);
  const auto frame = [&](Compositing compositing, Look look) {
    Style style;
    style.sampling.compositing = compositing;
    style.look = look;
    const auto picture = renderer.picture(view, style);
    std::vector<int> seen;
    for (const int row : {25, 60})
      for (int i = 5; i < view.width; i += 10)
        for (const int channel : {0, 2}) seen.push_back(picture[3 * (row * view.width + i) + channel]);
    return seen;
  };
  for (const auto& stored : kStoredFrames) {
    const std::vector<int> seen = frame(stored.compositing, stored.look);
    double sum = 0;
    int largest = 0;
    for (std::size_t i = 0; i < seen.size(); ++i) {
      sum += std::abs(seen[i] - stored.pixels[i]);
      largest = std::max(largest, std::abs(seen[i] - stored.pixels[i]));
    }
    // Drivers round exp and positions in their own ways: by one grey level, or the share of a pixel's edge
    // that a few of them show.
    EXPECT_LE(sum / static_cast<double>(seen.size()), 0.5) << fmt::format("{}", fmt::join(seen, ", "));
    EXPECT_LE(largest, 6) << fmt::format("{}", fmt::join(seen, ", "));
  }
}

TEST_F(RendererTest, DetectorIsTheNearSide) {
  // Only what lies anterior absorbs. Seen from the front it hides a vessel, seen from behind it does not;
  // under a cone too, whose rays come from the other side.
  auto map = homogeneous(1);
  for (std::size_t i = 0; i < map->tau.size(); ++i)
    map->tau[i] = std::cos(map->geometry.phi_rad(static_cast<double>(i % 360))) > 0 ? 3.0f : 0.0f;
  Renderer renderer;
  renderer.set_map(map);
  renderer.set_surfaces(std::vector<Surface>{{ball(bounds_of(map->geometry).centre_mm, 15), 0, {1, 0, 0}}});
  Style style;
  style.look = Look::surface;
  for (const Compositing compositing : {Compositing::wall, Compositing::path})
    for (const auto& cone : {std::optional<Cone>(), std::optional<Cone>(Cone{1000, 1500})}) {
      style.sampling.compositing = compositing;
      const View front = view_of_map(*map, 0, 0, cone), back = view_of_map(*map, 180, 0, cone);
      const std::size_t middle = 60 * 161 + 80;
      const auto from_front = renderer.picture(front, style), from_behind = renderer.picture(back, style);
      // exp(-3) of 8-bit red at most, against all of it but what the light leaves.
      EXPECT_LT(from_front[3 * middle], 25);
      EXPECT_GT(from_behind[3 * middle], 240);
    }
}

TEST_F(RendererTest, SpheresAndBentCylindersAreTheLengthsOfRaysToo) {
  auto sphere = homogeneous(2);
  sphere->geometry.ray_layout = RayLayout::sphere;
  sphere->geometry.centre_z_mm = 5;
  auto bent = homogeneous(2);
  bent->geometry.centre_mm.assign(101, {20, -30});
  for (const auto& map : {sphere, bent}) {
    Renderer renderer;
    renderer.set_map(map);
    for (const auto& cone : {std::optional<Cone>(), std::optional<Cone>(Cone{1000, 1500})}) {
      const View view = view_of_map(*map, 40, 0, cone);
      const std::vector<float> tau = renderer.tau(view, {});
      // Two hundred steps of 32-bit positions; the middle ray runs through the centre.
      EXPECT_NEAR(tau[60 * view.width + 80], 2.0, 2e-3);
    }
  }
}

TEST_F(RendererTest, MarchingABentAxisAgreesWithColumnsAboutAStraightOne) {
  ComputeDevice device;
  Progress progress;
  const Phantom phantom = make_phantom("shepp-logan", {.size = Index3{96, 96, 40}});
  const ResidentScan scan = upload(device, generate(phantom, device, progress));
  const MapGeometry geometry =
      cylinder_map(scan.geometry(), 180, shell_radii_mm(RadiiRule::equal_area, 6, 110), glm::dvec2(2, 1));
  auto straight = std::make_shared<BodyMap>(cast(scan, geometry, Opacity::paper(), progress).map);
  auto bent = std::make_shared<BodyMap>(*straight);
  bent->geometry.centre_mm.assign(static_cast<std::size_t>(geometry.height), geometry.centre_mm[0]);
  Renderer columns, march;
  columns.set_map(straight);
  march.set_map(bent);
  for (const auto& [tilt_deg, cone] :
       {std::pair(0.0, std::optional<Cone>()), std::pair(12.0, std::optional<Cone>(Cone{800, 1200}))}) {
    const View view = view_of_map(*straight, 55, tilt_deg, cone);
    const auto a = columns.tau(view, {}), b = march.tau(view, {});
    double squares = 0;
    for (std::size_t i = 0; i < a.size(); ++i) squares += (a[i] - b[i]) * (a[i] - b[i]);
    // Two quadratures of the same function: a tenth of what the map itself is off from the truth.
    EXPECT_LT(std::sqrt(squares / static_cast<double>(a.size())) / *std::ranges::max_element(a), 0.01)
        << tilt_deg;
  }
}

/// An elliptic cylinder of water, or a round one, and shells that follow it.
std::shared_ptr<BodyMap> water_cylinder(ComputeDevice& device, double a_mm, double b_mm,
                                        const ResidentScan** scan) {
  static std::vector<std::unique_ptr<ResidentScan>> scans;
  Volume volume({{240, 240, 24}, {1, 1, 2}, {-119.5, -119.5, -23}});
  const VolumeGeometry& g = volume.geometry();
  for (std::int64_t z = 0; z < g.size.z; ++z)
    for (std::int64_t y = 0; y < g.size.y; ++y)
      for (std::int64_t x = 0; x < g.size.x; ++x) {
        const glm::dvec3 p = g.to_world_mm({x, y, z});
        volume.at(x, y, z) = std::hypot(p.x / a_mm, p.y / b_mm) < 0.96 ? 0 : -1024;
      }
  scans.push_back(std::make_unique<ResidentScan>(upload(device, volume)));
  *scan = scans.back().get();
  const MapGeometry circles =
      cylinder_map(g, 360, shell_radii_mm(RadiiRule::near_skin, 16, a_mm), glm::dvec2(0));
  std::vector<float> outline_mm;
  for (int i = 0; i < 360; ++i) {
    const double phi = circles.phi_rad(i);
    outline_mm.push_back(static_cast<float>(1 / std::hypot(std::sin(phi) / a_mm, std::cos(phi) / b_mm)));
  }
  Progress progress;
  const MapGeometry geometry = a_mm == b_mm ? circles : with_outline(circles, outline_mm);
  return std::make_shared<BodyMap>(cast(**scan, geometry, Opacity::paper(), progress).map);
}

/// RMS difference of frames to the matter in shells, as a share of the largest depth.
double error_within(const MapGeometry& shells, const std::shared_ptr<BodyMap>& map, const ResidentScan& scan,
                    const View& view) {
  Renderer renderer;
  renderer.set_map(map);
  const auto drawn = renderer.tau(view, {});
  std::vector<RaySegment> segments;
  const auto parts = segments_within(view, shells);
  for (const PixelSegment& part : parts) segments.push_back(part.segment);
  Progress progress;
  const auto depths = project(scan, segments, map->opacity(), progress);
  std::vector<double> truth(drawn.size());
  for (std::size_t i = 0; i < parts.size(); ++i) truth[parts[i].pixel] += depths[i];
  double squares = 0;
  for (std::size_t i = 0; i < drawn.size(); ++i) squares += (drawn[i] - truth[i]) * (drawn[i] - truth[i]);
  return std::sqrt(squares / static_cast<double>(drawn.size())) / std::ranges::max(truth);
}

/// The same of the matter in the map's own.
double error_of(const std::shared_ptr<BodyMap>& map, const ResidentScan& scan, const View& view) {
  return error_within(map->geometry, map, scan, view);
}

TEST_F(RendererTest, AnEllipticCylinderUnderItsOutlineIsDrawnAsExactlyAsARoundOneUnderCircles) {
  ComputeDevice device;
  const ResidentScan *round_scan = nullptr, *elliptic_scan = nullptr;
  const auto round = water_cylinder(device, 90, 90, &round_scan),
             elliptic = water_cylinder(device, 110, 70, &elliptic_scan);
  for (const auto& [tilt_deg, cone] :
       {std::pair(0.0, std::optional<Cone>()), std::pair(20.0, std::optional<Cone>(Cone{1000, 1500}))})
    for (const double angle_deg : {0.0, 30.0, 90.0}) {
      const double as_round = error_of(round, *round_scan, view_of_map(*round, angle_deg, tilt_deg, cone)),
                   as_elliptic =
                       error_of(elliptic, *elliptic_scan, view_of_map(*elliptic, angle_deg, tilt_deg, cone));
      // Shells are as thick, as shares of R; voxels are not, as shares of the narrow side.
      EXPECT_LT(as_elliptic, 1.3 * as_round + 5e-4) << angle_deg << ' ' << tilt_deg;
      EXPECT_LT(as_elliptic, 0.01) << angle_deg << ' ' << tilt_deg;
    }
}

TEST_F(RendererTest, MarchingUnderAnOutlineAgreesWithColumns) {
  ComputeDevice device;
  const ResidentScan* scan = nullptr;
  const auto straight = water_cylinder(device, 110, 70, &scan);
  auto bent = std::make_shared<BodyMap>(*straight);
  bent->geometry.centre_mm.assign(static_cast<std::size_t>(bent->geometry.height), glm::dvec2(0));
  auto of_rows = std::make_shared<BodyMap>(*straight);
  of_rows->geometry.outline_mm.clear();
  for (int row = 0; row < of_rows->geometry.height; ++row)
    for (const float radius_mm : straight->geometry.outline_mm)
      of_rows->geometry.outline_mm.push_back(radius_mm);
  Renderer columns, march;
  columns.set_map(straight);
  const View view = view_of_map(*straight, 55, 12, Cone{800, 1200});
  for (const Compositing compositing : {Compositing::path, Compositing::wall}) {
    Style style;
    style.sampling.compositing = compositing;
    const auto a = columns.tau(view, style);
    for (const auto& map : {bent, of_rows}) {
      march.set_map(map);
      const auto b = march.tau(view, style);
      double squares = 0;
      for (std::size_t i = 0; i < a.size(); ++i) squares += (a[i] - b[i]) * (a[i] - b[i]);
      // Two quadratures of the same function; walls have hard edges, which a ray's steps miss by up to one.
      EXPECT_LT(std::sqrt(squares / static_cast<double>(a.size())) / std::ranges::max(a),
                compositing == Compositing::path ? 0.01 : 0.05);
    }
  }
}

/// A narrow cylinder of water that stands on a wide one, under an outline of its own each, from seed to seed
/// about another axis; or under the wide one's outline for both.
std::shared_ptr<BodyMap> stacked_cylinders(ComputeDevice& device, int seed, bool has_bands,
                                           std::unique_ptr<ResidentScan>& scan) {
  const int border = 12 + 5 * seed;
  Volume volume({{240, 240, 48}, {1, 1, 2}, {-119.5, -119.5, -47}});
  const VolumeGeometry& g = volume.geometry();
  const double wide_mm = 100 - 6 * seed, narrow_mm = 45 + 4 * seed;
  for (std::int64_t z = 0; z < g.size.z; ++z)
    for (std::int64_t y = 0; y < g.size.y; ++y)
      for (std::int64_t x = 0; x < g.size.x; ++x) {
        const glm::dvec3 p = g.to_world_mm({x, y, z});
        const double radius_mm = g.size.z - 1 - z < border ? narrow_mm : wide_mm;
        volume.at(x, y, z) = std::hypot(p.x, p.y) < 0.96 * radius_mm ? 0 : -1024;
      }
  scan = std::make_unique<ResidentScan>(upload(device, volume));
  const MapGeometry circles =
      cylinder_map(g, 360, shell_radii_mm(RadiiRule::near_skin, 16, wide_mm), glm::dvec2(0));
  std::vector<float> rows_mm;
  for (int row = 0; row < circles.height; ++row)
    rows_mm.insert(rows_mm.end(), 360, static_cast<float>(has_bands && row < border ? narrow_mm : wide_mm));
  Progress progress;
  return std::make_shared<BodyMap>(
      cast(*scan, with_outline(circles, rows_mm), Opacity::paper(), progress).map);
}

TEST_F(RendererTest, BandsOfRowsUnderOutlinesOfTheirOwnAreDrawnAsTheyWereCast) {
  ComputeDevice device;
  for (int seed = 0; seed < 3; ++seed) {
    std::unique_ptr<ResidentScan> scan;
    const auto banded = stacked_cylinders(device, seed, true, scan),
               plain = stacked_cylinders(device, seed, false, scan);
    for (const auto& [tilt_deg, cone] :
         {std::pair(0.0, std::optional<Cone>()), std::pair(0.0, std::optional<Cone>(Cone{800, 1200})),
          std::pair(20.0, std::optional<Cone>(Cone{800, 1200}))}) {
      const View view = view_of_map(*plain, 35.0 * seed, tilt_deg, cone);
      // No matter lies beyond the narrow shells but between the two slices beside the border, which the wide
      // ones hold: both maps show the same body.
      const double of_bands = error_within(plain->geometry, banded, *scan, view),
                   of_one = error_of(plain, *scan, view);
      EXPECT_LT(of_bands, 1.05 * of_one) << seed << ' ' << tilt_deg;
      // Voxels' steps at the skin, as for one cylinder (above).
      EXPECT_LT(of_bands, 0.01) << seed << ' ' << tilt_deg;
    }
  }
}

TEST_F(RendererTest, TiltedRaysAcrossABorderOfBandsCountWhatTheyMeetOnce) {
  ComputeDevice device;
  Progress progress;
  Volume volume({{120, 120, 60}, {2, 2, 2}, {-119, -119, -59}});
  const VolumeGeometry& g = volume.geometry();
  for (std::int64_t z = 0; z < g.size.z; ++z)
    for (std::int64_t y = 0; y < g.size.y; ++y)
      for (std::int64_t x = 0; x < g.size.x; ++x) {
        const glm::dvec3 p = g.to_world_mm({x, y, z});
        volume.at(x, y, z) = std::hypot(p.x, p.y) < 58 ? 0 : -1024;
      }
  const ResidentScan scan = upload(device, volume);
  // Few layers: a ray passes many rows in one of them.
  const MapGeometry circles =
      cylinder_map(g, 360, shell_radii_mm(RadiiRule::near_skin, 4, 100), glm::dvec2(0));
  std::vector<float> rows_mm;
  for (int row = 0; row < circles.height; ++row)
    rows_mm.insert(rows_mm.end(), 360, row < 24 ? 60.0f : 100.0f);
  auto map =
      std::make_shared<BodyMap>(cast(scan, with_outline(circles, rows_mm), Opacity::paper(), progress).map);
  Renderer renderer;
  renderer.set_map(map);
  for (const double tilt_deg : {-15.0, 15.0}) {
    const View view = view_of_map(*map, 10, tilt_deg, Cone{800, 1200});
    const auto drawn = renderer.tau(view, {}), truth = project(scan, view, Opacity::paper(), progress).tau;
    for (int y = view.height * 3 / 10; y < view.height * 6 / 10; ++y) {  // about the border
      const auto middle = static_cast<std::size_t>(y) * view.width + view.width / 2;
      // Counted twice, or not at all, half a layer is an eighth. The wide shells smear the skin.
      EXPECT_NEAR(drawn[middle], truth[middle], 0.06 * truth[middle]) << tilt_deg << ' ' << y;
    }
  }
}

TEST_F(RendererTest, MarchingThroughBandsOfRowsAgreesWithColumns) {
  ComputeDevice device;
  std::unique_ptr<ResidentScan> scan;
  const auto map = stacked_cylinders(device, 1, true, scan);
  Renderer renderer;
  renderer.set_map(map);
  const View view = view_of_map(*map, 20, 10, Cone{800, 1200});
  const auto columns = renderer.tau(view, {});
  // The same rows under an axis of rows of their own are drawn by marching.
  auto bent = std::make_shared<BodyMap>(*map);
  bent->geometry.centre_mm.assign(static_cast<std::size_t>(bent->geometry.height), glm::dvec2(0));
  renderer.set_map(bent);
  const auto march = renderer.tau(view, {});
  double squares = 0;
  for (std::size_t i = 0; i < columns.size(); ++i)
    squares += (columns[i] - march[i]) * (columns[i] - march[i]);
  // Two quadratures; marching blends the outlines of the two rows beside a border, columns their values.
  EXPECT_LT(std::sqrt(squares / static_cast<double>(columns.size())) / std::ranges::max(columns), 0.015);
}

TEST_F(RendererTest, ManyLayersApproachTheTrueProjection) {
  ComputeDevice device;
  Progress progress;
  const Phantom phantom = make_phantom("shepp-logan", {.size = Index3{128, 128, 64}});
  const ResidentScan scan = upload(device, generate(phantom, device, progress));
  double rms_before = 1;
  for (const int layers : {4, 16}) {
    const MapGeometry geometry =
        cylinder_map(scan.geometry(), 360, shell_radii_mm(RadiiRule::equal_area, layers, 125), glm::dvec2(0));
    auto map = std::make_shared<BodyMap>(cast(scan, geometry, Opacity::paper(), progress).map);
    Renderer renderer;
    renderer.set_map(map);
    const View view = view_of_map(*map, 20);
    const auto drawn = renderer.tau(view, {});
    const auto truth = project(scan, view, Opacity::paper(), progress).tau;
    double squares = 0;
    for (std::size_t i = 0; i < drawn.size(); ++i) squares += (drawn[i] - truth[i]) * (drawn[i] - truth[i]);
    const double rms =
        std::sqrt(squares / static_cast<double>(drawn.size())) / *std::ranges::max_element(truth);
    // Real heads have 2 % with 16 layers.
    EXPECT_LT(rms, layers == 16 ? 0.02 : 1.0);
    EXPECT_LT(rms, 0.6 * rms_before);
    rms_before = rms;
  }
}

TEST_F(RendererTest, RectangleMapsAreTrueProjectionsWhereTheyStoreOne) {
  // Matter all over the scan, also beyond the map's radius; slices and pixels of which no whole number fits.
  ComputeDevice device;
  Progress progress;
  constexpr double kPixel_mm = 0.9570312, kSlice_mm = 1.5;
  Volume volume({{128, 128, 51}, {kPixel_mm, kPixel_mm, kSlice_mm}, {-60.7, -60.7, -37.5}});
  for (std::int64_t z = 0; z < 51; ++z)
    for (std::int64_t y = 0; y < 128; ++y)
      for (std::int64_t x = 0; x < 128; ++x)
        volume.at(x, y, z) = static_cast<std::int16_t>(x * y % 97 * 10 - 600 + 500 * (z % 2));
  const ResidentScan scan = upload(device, volume);
  const MapGeometry geometry = rectangle_map(scan.geometry(), 6, 47.3, {3, -2});
  auto map = std::make_shared<BodyMap>(cast(scan, geometry, Opacity::paper(), progress).map);
  Renderer renderer;
  renderer.set_map(map);
  const BodyBounds bounds = bounds_of(geometry);
  for (const double angle_deg : {0.0, 60.0, 150.0, 270.0}) {
    const View view = fitted(View{.lao_rad = angle_deg * kRadians, .centre_mm = bounds.centre_mm}, bounds);
    const auto drawn = renderer.tau(view, {});
    const auto rays = rays_within(view, geometry);
    std::vector<RaySegment> segments;
    for (const auto& ray : rays) segments.push_back(ray.value_or(RaySegment{}));
    const auto truth = project(scan, segments, Opacity::paper(), progress);
    ASSERT_EQ(drawn.size(), truth.size());
    double squares = 0;
    for (std::size_t i = 0; i < drawn.size(); ++i) squares += (drawn[i] - truth[i]) * (drawn[i] - truth[i]);
    // 24-bit floats of positions and sums, and the chords that graze the circle. Half a row off, or with
    // what lies beyond the radius, it is a hundred times as much.
    EXPECT_LT(std::sqrt(squares / static_cast<double>(drawn.size())) / *std::ranges::max_element(truth), 2e-4)
        << angle_deg;
  }
}

TEST_F(RendererTest, MatterUpToTheScansBorderIsDrawnUpToThereAndNoFarther) {
  // Water everywhere in a scan whose corners the maps reach beyond: the truth is the rays' lengths in a box.
  ComputeDevice device;
  Progress progress;
  const VolumeGeometry volume{{61, 91, 40}, {1, 1, 1.5}, {-30, -45, -29.25}};
  Volume water(volume);
  std::ranges::fill(water.hu(), std::int16_t{0});
  const ResidentScan scan = upload(device, water);
  const auto radii_mm = shell_radii_mm(RadiiRule::equal_area, 6, 70);
  MapGeometry bent = cylinder_map(volume, 360, radii_mm, glm::dvec2(4, -3));
  bent.centre_mm.assign(40, {4, -3});
  for (const MapGeometry& geometry : {cylinder_map(volume, 360, radii_mm, glm::dvec2(4, -3)),
                                      sphere_map(volume, 360, radii_mm, {4, -3, 5}), bent}) {
    auto map = std::make_shared<BodyMap>(cast(scan, geometry, Opacity::paper(), progress).map);
    Renderer renderer;
    renderer.set_map(map);
    MapGeometry covered = geometry;
    covered.centre_mm.resize(1);
    for (const auto& [angle_deg, cone] :
         {std::pair(0.0, std::optional<Cone>()), std::pair(33.0, std::optional<Cone>()),
          std::pair(120.0, std::optional<Cone>(Cone{700, 1000}))}) {
      View view = view_of_map(*map, angle_deg, 0, cone);
      view.centre_mm.z += 0.2;  // no ray along the end of the scan, which may count or not
      const auto drawn = renderer.tau(view, {});
      const auto rays = rays_within(view, covered);
      std::vector<RaySegment> segments;
      for (const auto& ray : rays) segments.push_back(ray.value_or(RaySegment{}));
      const auto truth = project(scan, segments, Opacity::paper(), progress);
      double squares = 0;
      for (std::size_t i = 0; i < drawn.size(); ++i) squares += (drawn[i] - truth[i]) * (drawn[i] - truth[i]);
      // 32-bit sums. Under a cone columns are blended, which rounds off where rays pass the scan's edge, and
      // at a cylinder's ends a ray's last sample counts whole or not at all; without the field it is a
      // hundred times that.
      EXPECT_LT(std::sqrt(squares / static_cast<double>(drawn.size())), cone ? 1e-2 : 1e-4)
          << to_string(geometry.ray_layout) << ' ' << angle_deg;
    }
  }
}

TEST_F(RendererTest, HalfTheColumnsShowTheSame) {
  ComputeDevice device;
  Progress progress;
  const Phantom phantom = make_phantom("head", {.size = Index3{192, 192, 160}});
  const ResidentScan scan = upload(device, generate(phantom, device, progress));
  const MapGeometry geometry =
      cylinder_map(scan.geometry(), 360, shell_radii_mm(RadiiRule::equal_area, 8, 110), glm::dvec2(0));
  auto map = std::make_shared<BodyMap>(cast(scan, geometry, Opacity::paper(), progress).map);
  Renderer renderer;
  renderer.set_map(map);
  const BodyBounds bounds = bounds_of(geometry);
  renderer.set_surfaces(std::vector<Surface>{{ball(bounds.centre_mm, 25), 0.02, {1, 0, 0}}});
  for (const Look look : {Look::fluoro, Look::surface})
    for (const double zoom : {1.0, 3.0}) {
      Style full, half;
      full.look = look;
      CArmPose pose;
      pose.zoom = zoom;
      const View view = view_of(pose, bounds, 640, 480);
      full.window = automatic_window(renderer.tau(view, full));
      half = full;
      half.pixels_per_column = 2;
      const auto a = renderer.picture(view, full), b = renderer.picture(view, half);
      double sum = 0;
      int largest = 0;
      for (std::size_t i = 0; i < a.size(); ++i) {
        sum += std::abs(a[i] - b[i]);
        largest = std::max(largest, std::abs(a[i] - b[i]));
      }
      // What nobody sees: 2 of 255 in the mean and 10 at most.
      EXPECT_LE(sum / static_cast<double>(a.size()), 2);
      EXPECT_LE(largest, 10);
    }
}

TEST_F(RendererTest, LivePulsesHaveTheDepthsOfFullResolution) {
  ComputeDevice device;
  Progress progress;
  const Phantom phantom = make_phantom("thorax", {.size = Index3{160, 160, 180}});
  const ResidentScan scan = upload(device, generate(phantom, device, progress));
  const VolumeGeometry& g = scan.geometry();
  const glm::dvec3 middle = g.to_world_mm(0.5 * glm::dvec3(g.size - Index3(1)));
  const MapGeometry geometry =
      cylinder_map(g, 360, shell_radii_mm(RadiiRule::equal_area, 8, 200), glm::dvec2(middle));
  Renderer renderer;
  renderer.set_map(std::make_shared<BodyMap>(cast(scan, geometry, Opacity::paper(), progress).map));
  View view{.cone = Cone{1000, 1500}, .width = 640, .height = 480};
  view = fitted(view, bounds_of(geometry));
  Style live;
  live.pixels_per_column = kLivePixelsPerColumn;
  const std::vector<float> full = renderer.tau(view, {}), coarse = renderer.tau(view, live);
  double squares = 0;
  for (std::size_t i = 0; i < full.size(); ++i) squares += std::pow(coarse[i] - full[i], 2);
  // A pulse of fluoroscopy detects some thousand quanta in a pixel, whose noise is 0.03 of optical depth.
  EXPECT_LT(std::sqrt(squares / static_cast<double>(full.size())), 0.01);
}

TEST_F(RendererTest, SpectrumMapsAreSummedBeforeTheSpectrum) {
  auto map = homogeneous(2);
  map->tau.clear();
  map->attenuation = Spectrum::named("80");
  for (std::size_t m = 0; m < kMaterials.size(); ++m)
    map->depths[m].assign(2 * map->layer_size(), m == 0 ? 5.0f : m == 1 ? 1.0f : 0.002f);
  Renderer renderer;
  renderer.set_map(map);
  const View view = view_of_map(*map, 0);
  // The middle ray meets both layers twice.
  const MaterialDepths whole{{{20.0f}, {4.0f}, {0.008f}}};
  // 32-bit sums and exponentials of some eighty bins.
  EXPECT_NEAR(renderer.tau(view, {})[60 * view.width + 80], SpectrumModel(*map->spectrum()).tau(whole)[0],
              1e-3);
}

TEST_F(RendererTest, GreyIsWhatTheWindowSays) {
  const auto map = homogeneous(1);
  Renderer renderer;
  renderer.set_map(map);
  const View view = view_of_map(*map, 0);
  const auto tau = renderer.tau(view, {});
  for (const GreyWindow& window :
       {GreyWindow{}, GreyWindow{4, 0.2, 0.9, 1, false}, GreyWindow{4, 0.2, 0.9, 2.2, true}}) {
    Style style;
    style.window = window;
    const auto picture = renderer.picture(view, style);
    for (std::size_t i = 0; i < tau.size(); i += 37)
      // Rounding to 8 bits, either way.
      EXPECT_NEAR(picture[3 * i], 255 * window.grey(tau[i]), 1.01) << i;
  }
}

TEST_F(RendererTest, BrightnessFollowsWhatIsSeen) {
  // A body whose lower half is ten times as dense as its upper one. Zoomed in on either half, the frame spans
  // the greys, whatever the other half is like; gamma and inversion stay.
  auto map = homogeneous(1);
  for (std::size_t i = 0; i < map->tau.size(); ++i)
    map->tau[i] = (i / 360 < 50 ? 0.3f : 3.0f) * (i % 360 < 180 ? 0.5f : 1.0f);
  Renderer renderer;
  renderer.set_map(map);
  CArmPose pose{.zoom = 4};
  Style style;
  style.window.gamma = 1.5;
  style.window.inverted = true;
  std::vector<GreyWindow> windows;
  for (const double table_mm : {30.0, -30.0}) {
    pose.table_mm = table_mm;
    const View view = view_of(pose, bounds_of(map->geometry), 320, 240);
    style.window = automatic_window(renderer, view, style);
    windows.push_back(style.window);
    EXPECT_EQ(style.window.gamma, 1.5);
    EXPECT_TRUE(style.window.inverted);
    const auto picture = renderer.picture(view, style);
    const auto [least, most] = std::ranges::minmax(picture);
    EXPECT_LT(least, 20) << table_mm;
    EXPECT_GT(most, 150) << table_mm;
  }
  // Its scale is that of the half that is seen.
  EXPECT_NEAR(windows[1].scale / windows[0].scale, 10, 0.5);
}

TEST_F(RendererTest, WhatWasDrawnBeforeLeavesNoTrace) {
  // A body that is kept between frames must not outlive its map, view or style.
  const auto map = homogeneous(2), other = homogeneous(3);
  const Surface near{ball(bounds_of(map->geometry).centre_mm + glm::dvec3(0, -40, 0), 20), 0.05, {}};
  const View view = view_of_map(*map, 0), turned = view_of_map(*map, 50);
  ProjectionImage truth{view, std::vector<float>(static_cast<std::size_t>(view.width) * view.height, 0.5f)};
  Style surface{.look = Look::surface}, weak, wall, coarse;
  weak.layer_weights = {0.5f, 1};
  wall.sampling.compositing = Compositing::wall;
  coarse.pixels_per_column = 2;
  const std::tuple<std::shared_ptr<BodyMap>, View, Style> frames[] = {
      {map, view, {}},   {map, view, surface}, {map, turned, {}}, {other, turned, {}}, {map, view, weak},
      {map, view, wall}, {map, view, coarse},  {map, view, {}},   {map, view, {}}};
  Renderer kept;
  for (const auto& [its_map, its_view, style] : frames) {
    Renderer fresh;
    fresh.set_map(its_map);
    kept.set_map(its_map);
    for (const bool has_surface : {false, true}) {
      for (Renderer* renderer : {&fresh, &kept})
        renderer->set_surfaces(std::span(&near, has_surface ? 1 : 0));
      EXPECT_EQ(kept.picture(its_view, style), fresh.picture(its_view, style));
    }
    kept.picture(truth, {});
    EXPECT_EQ(kept.tau(its_view, style), fresh.tau(its_view, style));
  }
}

TEST_F(RendererTest, AStillViewDrawsTheBodyOnce) {
  const auto map = homogeneous(64);
  const View view = view_of_map(*map, 0, 0, Cone{1000, 1500});
  Renderer renderer;
  renderer.set_map(map);
  const auto fastest_ms = [&](auto&& make_view) {
    double fastest = 1e9;
    for (int i = 0; i < 5; ++i) {
      const Stopwatch stopwatch;
      renderer.picture(make_view(i), {});
      fastest = std::min(fastest, stopwatch.ms());
    }
    return fastest;
  };
  const double moving = fastest_ms([&](int i) { return view_of_map(*map, i, 0, Cone{1000, 1500}); });
  renderer.picture(view, {});
  const double still = fastest_ms([&](int) { return view; });
  // 64 layers take most of a frame; a third leaves room for a machine under load.
  EXPECT_LT(still, moving / 3);
}

TEST_F(RendererTest, LeavesNothingBehind) {
  const int before = gl::objects_alive();
  for (int round = 0; round < 20; ++round) {
    const auto map = homogeneous(2);
    Renderer renderer;
    renderer.set_map(map);
    renderer.set_surfaces(std::vector<Surface>{{ball({}, 5), 0.1, {}}});
    renderer.tau(view_of_map(*map, 0), {});
  }
  EXPECT_EQ(gl::objects_alive(), before);
}

TEST_F(RendererTest, MapsTallerThanATextureAreDrawnToTheirLastRow) {
  // Ten rows twice as dense at the lower end of more than OpenGL draws into.
  auto map = homogeneous(1);
  map->geometry.width = 4;
  map->geometry.height = 20000;
  map->geometry.row_spacing_mm = 0.01;
  map->geometry.top_mm = 100;
  map->tau.assign(map->layer_size(), 1.0f);
  std::fill(map->tau.end() - 40, map->tau.end(), 2.0f);
  Renderer renderer;
  renderer.set_map(map);
  View view = view_of_map(*map, 0);
  view.pixel_mm = 0.01;
  view.centre_mm.z = map->geometry.z_mm(19999.5);
  const std::vector<float> tau = renderer.tau(view, {});
  // 32-bit sums of a hundred parts.
  EXPECT_NEAR(tau[45 * view.width + 80], 2.0, 1e-5);
  EXPECT_NEAR(tau[55 * view.width + 80], 4.0, 1e-5);
  EXPECT_EQ(tau[62 * view.width + 80], 0);
}

TEST_F(RendererTest, WhatIsLargerThanTheDriverTakesIsRefused) {
  GLint side = 0, texels = 0;
  glGetIntegerv(GL_MAX_TEXTURE_SIZE, &side);
  glGetIntegerv(GL_MAX_TEXTURE_BUFFER_SIZE, &texels);
  gl::Target target(GL_R32F);
  EXPECT_THROW(target.resize(side + 1, 4), InputError);
  EXPECT_THROW(target.resize(4, side + 1), InputError);
  // More values than there are: none of them is read.
  const float value = 0;
  EXPECT_THROW(gl::Table(GL_R32F).fill({&value, static_cast<std::size_t>(texels) + 1}, "a map"), InputError);
  auto map = homogeneous(1);
  map->geometry.ray_layout = RayLayout::rectangle;
  map->geometry.width = 16384;
  map->geometry.views = 1025;
  map->geometry.height = 0;  // so that it takes no memory here
  map->tau.clear();
  Renderer renderer;
  renderer.set_map(map);
  EXPECT_THROW(renderer.tau(view_of_map(*homogeneous(1), 0), {}), InputError);
}

TEST_F(RendererTest, RefusesSurfacesThatAreNotFinite) {
  Renderer renderer;
  Mesh mesh = ball({}, 5);
  mesh.points_mm[7].y = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THROW(renderer.set_surfaces(std::vector<Surface>{{mesh, 0.1, {}}}), InputError);
}

}  // namespace
}  // namespace xraycast::renderer_gl_test
