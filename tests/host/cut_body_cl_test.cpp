// Bodies that the scan cuts off: voxels have extent, so the scan ends at the faces of its border voxels, in
// all kernels.
#include "support/lengths.hpp"
#include "support/reference.hpp"
#include "support/shared_device.hpp"
#include "xraycast/casting/caster.hpp"
#include "xraycast/casting/recast.hpp"
#include "xraycast/casting/spectral_scan.hpp"
#include "xraycast/projection/projector.hpp"
#include "xraycast/requests/slab_caster.hpp"

#include <fmt/format.h>
#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <random>
#include <vector>

namespace xraycast::test::cut_body_cl_test {
namespace {

constexpr double kRadians = std::numbers::pi / 180;

Volume water_in(const Index3& size, const glm::dvec3& spacing_mm) {
  return make_volume(size, spacing_mm, [](const glm::dvec3&) { return 0; });
}

/// One column, row and slice, a single voxel, and what seeds give.
std::vector<Volume> cut_bodies() {
  std::vector<Volume> bodies;
  for (const Index3& size : {Index3{1, 40, 33}, {37, 1, 20}, {30, 34, 1}, {1, 1, 50}, {1, 1, 1}})
    bodies.push_back(water_in(size, {1.3, 0.9, 1.7}));
  std::mt19937 random(17);
  std::uniform_int_distribution<int> voxels(2, 70);
  std::uniform_real_distribution<double> mm(0.4, 2.5);
  for (int seed = 0; seed < 8; ++seed) {
    const int x = voxels(random), y = voxels(random), z = voxels(random);
    const double dx = mm(random), dy = mm(random), dz = mm(random);
    bodies.push_back(water_in({x, y, z}, {dx, dy, dz}));
  }
  return bodies;
}

std::string text_of(const Volume& volume) {
  const VolumeGeometry& g = volume.geometry();
  return fmt::format("{} x {} x {} voxels of {:.2f} x {:.2f} x {:.2f} mm", g.size.x, g.size.y, g.size.z,
                     g.spacing_mm.x, g.spacing_mm.y, g.spacing_mm.z);
}

std::vector<ScanStorage> storages() {
  if (device().self_test().images) return {ScanStorage::bricks, ScanStorage::image};
  return {ScanStorage::bricks};
}

/// Along the axes and obliquely, in parallel beams and cones.
std::vector<View> views_of(const VolumeGeometry& volume) {
  const double reach_mm = glm::length(volume.upper_mm() - volume.lower_mm());
  std::vector<View> views;
  for (const double tilt_deg : {0.0, 20.0, 90.0})
    for (const double angle_deg : {0.0, 90.0, 33.0, 250.0})
      for (const std::optional<Cone>& cone : {std::optional<Cone>(), std::optional(Cone{900, 1400})})
        // Off the middle, so that no ray runs in a face itself, where it counts or not by rounding.
        views.push_back({.lao_rad = angle_deg * kRadians,
                         .cranial_rad = tilt_deg * kRadians,
                         .cone = cone,
                         .centre_mm = {0.013, -0.021, 0.017},
                         .width = 41,
                         .height = 37,
                         .pixel_mm = 1.2 * reach_mm / 40 * (cone ? 1400.0 / 900 : 1)});
  return views;
}

RaySegment ray_of(const View& view, int i, int j) {
  const glm::dvec3 pixel_mm = view.pixel_on_detector_mm(i, j);
  if (view.cone) return {view.source_mm(), view.source_mm() + 2.0 * (pixel_mm - view.source_mm())};
  return {pixel_mm - 500.0 * view.towards_detector(), pixel_mm + 500.0 * view.towards_detector()};
}

double chord_mm(const RaySegment& ray, const VolumeGeometry& volume) {
  return box_chord_mm(ray.start_mm, ray.end_mm, scan_extent(volume));
}

/// How far a picture is from the lengths of its rays in the box of the scan, in mm. Beside an edge of the box
/// a ray counts or does not by its place to 1e-4 mm, so the nearest ray around it may be the right one.
double worst_mm(const std::vector<float>& tau, const View& view, const VolumeGeometry& volume) {
  constexpr double kRounding_mm = 2e-4;
  double worst = 0;
  for (int j = 0; j < view.height; ++j)
    for (int i = 0; i < view.width; ++i) {
      double nearest = std::numeric_limits<double>::infinity();
      for (int around = 0; around < 9; ++around) {
        const glm::dvec3 aside =
            kRounding_mm * (double(around % 3 - 1) * view.right() + double(around / 3 - 1) * view.up());
        RaySegment ray = ray_of(view, i, j);
        ray.start_mm += aside;
        ray.end_mm += aside;
        nearest = std::min(
            nearest, std::abs(tau[static_cast<std::size_t>(j * view.width + i)] - chord_mm(ray, volume)));
      }
      worst = std::max(worst, nearest);
    }
  return worst;
}

// ---- projections

// Ends of rays are rounded to 1e-4 voxels, and a ray that leaves through a face along which it runs passes
// some twenty times as much of the scan.
constexpr double kClosed_mm = 5e-3;

TEST(CutBody, ProjectsToItsLengthFromFaceToFace) {
  Progress progress;
  for (const Volume& volume : cut_bodies())
    for (const ScanStorage storage : storages()) {
      const ResidentScan scan = upload(device(), volume, storage);
      for (const View& view : views_of(volume.geometry())) {
        const std::string name =
            fmt::format("{}, {}{}", text_of(volume), label(view), view.cone ? ", cone" : "");
        for (const Sampling sampling : {Sampling::skipping_constant_blocks, Sampling::everywhere})
          EXPECT_LT(
              worst_mm(project(scan, view, lengths(), progress, {}, sampling).tau, view, volume.geometry()),
              kClosed_mm)
              << name;
        EXPECT_LT(
            worst_mm(project_with_gradient(scan, view, lengths(), progress).tau, view, volume.geometry()),
            kClosed_mm)
            << name;
        if (view.cone) {
          EXPECT_LT(worst_mm(project(scan, camera_of(view), lengths(), progress), view, volume.geometry()),
                    kClosed_mm)
              << name;
        }
      }
    }
}

TEST(CutBody, IsItsLengthInTheReferenceToo) {
  for (const Volume& volume : cut_bodies())
    for (const View& view : views_of(volume.geometry()))
      for (int pixel = 0; pixel < view.width * view.height; pixel += 7) {
        const RaySegment ray = ray_of(view, pixel % view.width, pixel / view.width);
        ASSERT_NEAR(
            reference_joseph(volume, ray.start_mm, ray.end_mm, [](double hu) { return 1 + hu / 1024; }),
            chord_mm(ray, volume.geometry()), 1e-9)  // double precision
            << text_of(volume) << ", " << label(view);
      }
}

TEST(CutBody, OfThirtySixMillimetresOfWaterHasATauOf072) {
  const Volume volume = water_in({18, 18, 18}, {2, 2, 2});
  Progress progress;
  for (const double angle_deg : {0.0, 90.0}) {
    const View view{.lao_rad = angle_deg * kRadians, .width = 9, .height = 9, .pixel_mm = 4};
    for (const float tau : project(upload(device(), volume), view, Opacity::paper(), progress).tau)
      EXPECT_NEAR(tau, 0.72, 1e-5);  // 32-bit sums
  }
}

TEST(CutBody, IsHeldAtTheBorderVoxelsUpToTheirFaces) {
  // Matter that differs from voxel to voxel, along rays that leave through all faces.
  const Volume volume = textured_volume({23, 19, 26}, {1.3, 1.1, 1.7});
  const auto mu = [](double hu) { return Opacity::bilinear().mu_per_mm(hu); };
  Progress progress;
  for (const ScanStorage storage : storages()) {
    const ResidentScan scan = upload(device(), volume, storage);
    for (const View& view : views_of(volume.geometry())) {
      const auto tau = project(scan, view, Opacity::bilinear(), progress).tau;
      double worst = 0;
      for (int pixel = 0; pixel < view.width * view.height; ++pixel) {
        const RaySegment ray = ray_of(view, pixel % view.width, pixel / view.width);
        worst = std::max(worst, std::abs(tau[static_cast<std::size_t>(pixel)] -
                                         reference_joseph(volume, ray.start_mm, ray.end_mm, mu)));
      }
      // Places in voxels are good to 1e-4, and mu changes by up to 0.05 per mm in this noise.
      EXPECT_LT(worst, 1e-3) << label(view) << (view.cone ? ", cone" : "");
    }
  }
}

TEST(CutBody, HasTheMassesOfItsLengthUnderASpectrum) {
  const Volume volume = water_in({21, 17, 15}, {1.5, 2, 1.1});
  Progress progress;
  const View view{.lao_rad = 90 * kRadians, .width = 5, .height = 5, .pixel_mm = 2};
  const ProjectedMasses masses = project_masses({upload(device(), volume), {}}, view, progress);
  for (const float g_cm2 : masses.g_cm2[0]) EXPECT_NEAR(g_cm2, 0.1 * 21 * 1.5, 1e-5);
}

// ---- maps

/// From a map's centre along the ray of a texel, between two of its radii.
RaySegment ray_of(const MapGeometry& map, int layer, int row, int column) {
  const double phi = map.phi_rad(column), theta = map.theta_rad(row), scale = map.scale(column, row);
  glm::dvec3 from(map.centre_of_row_mm(row), map.z_mm(row)), along(radial_direction(phi), 0);
  if (map.ray_layout == RayLayout::sphere) {
    from.z = map.centre_z_mm;
    along = {std::sin(theta) * along.x, std::sin(theta) * along.y, std::cos(theta)};
  }
  return {from + scale * map.radii_mm[static_cast<std::size_t>(layer)] * along,
          from + scale * map.radii_mm[static_cast<std::size_t>(layer) + 1] * along};
}

/// The mean over the texels of how far a map of lengths is from them, and the largest, in mm.
struct Errors {
  double mean_mm = 0, worst_mm = 0;
};

Errors errors_of(const BodyMap& map, const VolumeGeometry& volume) {
  const MapGeometry& g = map.geometry;
  Errors errors;
  for (int k = 0; k < g.layers(); ++k)
    for (int row = 0; row < g.height; ++row)
      for (int column = 0; column < g.width; ++column) {
        const double error = map.layer(k)[static_cast<std::size_t>(row * g.width + column)] -
                             chord_mm(ray_of(g, k, row, column), volume);
        errors.mean_mm += error / static_cast<double>(map.tau.size());
        errors.worst_mm = std::max(errors.worst_mm, std::abs(error));
      }
  return errors;
}

/// Maps around a point off the middle, which reach beyond all faces and whose rays are sampled finely.
std::vector<MapGeometry> maps_of(const VolumeGeometry& volume) {
  const glm::dvec3 half_mm = 0.5 * (volume.upper_mm() - volume.lower_mm()), centre_mm = 0.21 * half_mm;
  std::vector<MapGeometry> maps;
  for (const int layers : {1, 5}) {
    maps.push_back(cylinder_map(
        volume, 64, shell_radii_mm(RadiiRule::equal_area, layers, 1.5 * glm::length(glm::dvec2(half_mm))),
        glm::dvec2(centre_mm)));
    maps.push_back(sphere_map(
        volume, 64, shell_radii_mm(RadiiRule::near_skin, layers, 1.5 * glm::length(half_mm)), centre_mm));
  }
  const auto outlined = [](const MapGeometry& map) {
    std::vector<float> outline_mm;
    for (int i = 0; i < map.width * (map.ray_layout == RayLayout::sphere ? map.height : 1); ++i)
      outline_mm.push_back(static_cast<float>(map.radius_mm() * (0.9 + 0.1 * std::sin(0.3 * i))));
    return with_outline(map, outline_mm);
  };
  maps.push_back(outlined(maps[2]));
  maps.push_back(outlined(maps[3]));
  MapGeometry curved = maps[2];
  curved.centre_mm.assign(static_cast<std::size_t>(curved.height), curved.centre_mm[0]);
  maps.push_back(curved);
  return maps;
}

TEST(CutBody, IsCastToItsLengthUpToTheFaces) {
  Progress progress;
  for (const Volume& volume : cut_bodies())
    for (const ScanStorage storage : storages()) {
      const ResidentScan scan = upload(device(), volume, storage);
      for (const MapGeometry& map : maps_of(volume.geometry())) {
        const Errors errors = errors_of(cast(scan, map, lengths(), progress).map, volume.geometry());
        // A ray ends after whole samples: half a step from the face at most, and floats.
        EXPECT_LT(errors.worst_mm, 0.5 * map.step_mm + 1e-3)
            << text_of(volume) << ", " << to_string(map.ray_layout);
      }
    }
}

TEST(CutBody, IsCastWithoutBias) {
  // Many samples and directions: whole samples err to both sides alike.
  const Volume volume = water_in({61, 73, 18}, {1.1, 0.8, 1.4});
  Progress progress;
  const ResidentScan scan = upload(device(), volume);
  for (MapGeometry map : maps_of(volume.geometry())) {
    const Errors errors = errors_of(cast(scan, map, lengths(), progress).map, volume.geometry());
    // Independent errors of up to half a step in 64 directions have a mean of 0.5 / sqrt(3 * 64) = 0.036 of
    // it.
    EXPECT_LT(std::abs(errors.mean_mm * map.layers()), 0.12 * map.step_mm) << to_string(map.ray_layout);
  }
}

TEST(CutBody, HasNoFacesBetweenSlabs) {
  const Volume volume = water_in({31, 27, 75}, {1.2, 0.9, 1.6});
  Progress progress;
  LoadTimings timings;
  const MapGeometry map = maps_of(volume.geometry())[0];
  const auto whole = cast(upload(device(), volume), map, lengths(), progress);
  VolumeSource source(volume);
  EXPECT_EQ(cast_by_slabs(device(), source, map, lengths(), 16, timings, progress).map.tau, whole.map.tau);
  EXPECT_LT(errors_of(whole.map, volume.geometry()).worst_mm, 0.5 * map.step_mm + 1e-3);  // as above
}

TEST(CutBody, IsRecastAsItIsCast) {
  const Volume volume = water_in({21, 27, 35}, {1.2, 0.9, 1.6});
  Progress progress;
  const ResidentScan scan = upload(device(), volume);
  const std::vector<double> knots_hu{-1024, 0};
  for (const MapGeometry& map : maps_of(volume.geometry())) {
    if (map.ray_layout == RayLayout::sphere) continue;
    RecastSession session(device(), make_basis(scan, map, knots_hu, progress));
    const auto warm = session.recast(lengths()), cold = cast(scan, map, lengths(), progress).map;
    for (std::size_t i = 0; i < cold.tau.size(); ++i)
      // Weights are rounded to 1 / 65535 of a shell's thickness.
      ASSERT_NEAR(warm.tau[i], cold.tau[i], map.radius_mm() / 65535 + 1e-4);
  }
}

TEST(CutBody, IsAsWideInAPictureMap) {
  const Volume volume = water_in({40, 30, 20}, {1, 1.2, 1.5});
  Progress progress;
  const MapGeometry map = rectangle_map(volume.geometry(), 2, 30, {0, 0});  // along y, and along x
  const auto tau = cast(upload(device(), volume), map, lengths(), progress).map.tau;
  const std::size_t middle = static_cast<std::size_t>(map.height / 2 * map.width + map.width / 2),
                    view = static_cast<std::size_t>(map.height * map.width);
  EXPECT_NEAR(tau[middle], 30 * 1.2, 1e-3);  // 24-bit floats
  EXPECT_NEAR(tau[view + middle], 40, 1e-3);
}

}  // namespace
}  // namespace xraycast::test::cut_body_cl_test
