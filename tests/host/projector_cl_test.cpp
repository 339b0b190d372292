#include "support/lengths.hpp"
#include "support/reference.hpp"
#include "support/shared_device.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/opencl/device_opacity.hpp"
#include "xraycast/phantom/phantom.hpp"
#include "xraycast/projection/projector.hpp"

#include <fmt/format.h>
#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <iterator>
#include <limits>
#include <numbers>
#include <ostream>
#include <random>
#include <unistd.h>

namespace xraycast::test::projector_cl_test {
namespace {

constexpr double kRadians = std::numbers::pi / 180;

std::vector<float> project_rays(const Volume& volume, std::span<const RaySegment> rays,
                                const Opacity& opacity = lengths(),
                                ScanStorage storage = ScanStorage::bricks) {
  Progress progress;
  return project(upload(device(), volume, storage), rays, opacity, progress);
}

/// The rays of a view's pixels, row by row.
std::vector<RaySegment> rays_of(const View& view) {
  std::vector<RaySegment> rays;
  for (int j = 0; j < view.height; ++j)
    for (int i = 0; i < view.width; ++i) {
      const glm::dvec3 pixel_mm = view.pixel_on_detector_mm(i, j);
      if (view.cone)
        rays.push_back({view.source_mm(), pixel_mm});
      else
        rays.push_back(
            {pixel_mm - 2000.0 * view.towards_detector(), pixel_mm + 2000.0 * view.towards_detector()});
    }
  return rays;
}

/// RTK's bars for its forward projectors: mean absolute error below 1.28 mm and PSNR above 44 dB at a peak of
/// 255.
void expect_rtk_bars(const std::vector<float>& actual, const std::vector<double>& expected) {
  double absolute = 0, squared = 0;
  for (std::size_t i = 0; i < actual.size(); ++i) {
    absolute += std::abs(actual[i] - expected[i]);
    squared += (actual[i] - expected[i]) * (actual[i] - expected[i]);
  }
  const auto count = static_cast<double>(actual.size());
  EXPECT_LT(absolute / count, 1.28);
  EXPECT_GT(10 * std::log10(255 * 255 / (squared / count)), 44);
}

View cone_view(double angle_deg, double tilt_deg, const Cone& cone) {
  return {.lao_rad = angle_deg * kRadians,
          .cranial_rad = tilt_deg * kRadians,
          .cone = cone,
          .width = 64,
          .height = 65,
          .pixel_mm = 8};
}

class ProjectedView : public testing::TestWithParam<View> {};

TEST_P(ProjectedView, OfOnesIsTheLengthInTheScan) {
  const Volume volume = make_volume({64, 64, 64}, {4, 4, 4}, [](const glm::dvec3&) { return 0; });
  std::vector<double> expected;
  for (const RaySegment& ray : rays_of(GetParam()))
    expected.push_back(box_chord_mm(ray.start_mm, ray.end_mm, scan_extent(volume.geometry())));
  Progress progress;
  const auto image = project(upload(device(), volume), GetParam(), lengths(), progress);
  expect_rtk_bars(image.tau, expected);
  // We clip to the scan, so that more than RTK's bars holds: 24-bit floats over a few hundred mm.
  for (std::size_t i = 0; i < expected.size(); ++i)
    ASSERT_NEAR(image.tau[i], expected[i], 0.02) << "pixel " << i;
}

/// The part of a ray that lies in the cylinder over a circle, by the quadratic equation.
RaySegment within(const RaySegment& ray, const BodyOutline& circle) {
  const glm::dvec3 along = ray.end_mm - ray.start_mm;
  const glm::dvec2 from = glm::dvec2(ray.start_mm) - circle.centre_mm, way(along);
  const double a = glm::dot(way, way), b = glm::dot(from, way),
               c = glm::dot(from, from) - circle.radius_mm * circle.radius_mm, root_2 = b * b - a * c;
  if (root_2 <= 0) return {ray.start_mm, ray.start_mm};
  const double first = std::max(0.0, (-b - std::sqrt(root_2)) / a),
               last = std::min(1.0, (-b + std::sqrt(root_2)) / a);
  return {ray.start_mm + first * along, ray.start_mm + std::max(first, last) * along};
}

TEST_P(ProjectedView, WithinACylinderIsTheLengthInIt) {
  const Volume volume = make_volume({64, 64, 64}, {4, 4.5, 4}, [](const glm::dvec3&) { return 0; });
  const BodyOutline circle{{17, -11}, 70};
  Progress progress;
  for (const ScanStorage storage : {ScanStorage::bricks, ScanStorage::image}) {
    if (storage == ScanStorage::image && !device().self_test().images) continue;
    const ResidentScan scan = upload(device(), volume, storage);
    const auto image = project(scan, GetParam(), lengths(), progress, circle);
    const auto rays = rays_of(GetParam());
    for (std::size_t i = 0; i < rays.size(); ++i) {
      const RaySegment inside = within(rays[i], circle);
      // As above; where a ray grazes the circle, positions good to 1e-4 mm change its chord by
      // sqrt(2 * 70 * 1e-4) mm on both sides, and more along a steep one.
      ASSERT_NEAR(image.tau[i], box_chord_mm(inside.start_mm, inside.end_mm, scan_extent(volume.geometry())),
                  0.3)
          << "pixel " << i;
    }
  }
}

TEST_P(ProjectedView, EqualsTheReference) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> noise(-100, 100);
  const Volume volume = make_volume({50, 60, 37}, {2, 1.5, 2.5}, [&](const glm::dvec3& p) {
    return -500 + 400 * std::sin(p.x / 9) + 300 * std::cos(p.y * p.z / 60) + noise(random);
  });
  Progress progress;
  const ResidentScan scan = upload(device(), volume);
  std::vector<Opacity::Knot> knots;
  for (int i = 0; i < 20; ++i) knots.push_back({-1000.0 + 100 * i, 0.002 * (i % 5) + 0.0005 * i});
  const auto rays = rays_of(GetParam());
  for (const Opacity& opacity : {Opacity::paper(), Opacity::bilinear(), Opacity("20 knots", knots)}) {
    const auto image = project(scan, GetParam(), opacity, progress);
    for (std::size_t i = 0; i < rays.size(); ++i) {
      const double expected = reference_joseph(volume, rays[i].start_mm, rays[i].end_mm,
                                               [&](double hu) { return opacity.mu_per_mm(hu); });
      // Voxel coordinates of far sources are good to 1e-4 in 24-bit floats, and HU change by some hundred a
      // voxel.
      ASSERT_NEAR(image.tau[i], expected, 2e-3) << opacity.name() << ", pixel " << i;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(
    Project, ProjectedView,
    testing::Values(
        View{.width = 64, .height = 65, .pixel_mm = 5},
        View{.lao_rad = 37 * kRadians, .width = 64, .height = 65, .pixel_mm = 5},
        View{
            .lao_rad = 90 * kRadians, .cranial_rad = 25 * kRadians, .width = 64, .height = 65, .pixel_mm = 5},
        View{
            .lao_rad = 10 * kRadians, .cranial_rad = 80 * kRadians, .width = 64, .height = 65, .pixel_mm = 5},
        cone_view(0, 0, {1000, 1500}), cone_view(45, 0, {1000, 1500}), cone_view(200, 20, {600, 900}),
        cone_view(33, 5, {40, 500})));  // the source inside the scan

/// A scan's size and spacing, with a view of it.
struct SeenScan {
  Index3 size;
  glm::dvec3 spacing_mm;
  View view;
};

void PrintTo(const SeenScan& seen, std::ostream* out) {
  *out << fmt::format("{} x {} x {} voxels, {} x {} pixels of {} mm, {}{}", seen.size.x, seen.size.y,
                      seen.size.z, seen.view.width, seen.view.height, seen.view.pixel_mm, label(seen.view),
                      seen.view.cone ? ", cone" : "");
}

/// Pictures take many rays of a column at once, by ways that depend on tilt, pixels and slices; lists of rays
/// take each alone.
class ProjectedPicture : public testing::TestWithParam<SeenScan> {};

TEST_P(ProjectedPicture, EqualsItsRaysOneByOne) {
  const auto& [size, spacing_mm, view] = GetParam();
  std::mt19937 random(3);
  std::uniform_int_distribution<int> hu(-1024, 1500);
  const Volume volume = make_volume(size, spacing_mm, [&](const glm::dvec3&) { return hu(random); });
  std::vector<Opacity::Knot> knots;
  for (int i = 0; i < 64; ++i) knots.push_back({-1000.0 + 40 * i, 0.0005 * (i % 7) + 0.0002 * i});
  Progress progress;
  const ResidentScan scan = upload(device(), volume);
  const auto rays = rays_of(view);
  for (const Opacity& opacity :
       {Opacity::paper(), Opacity::bilinear(), Opacity("64 knots", knots), Opacity("even", {{0, 0.01}})}) {
    const auto alone = project(scan, rays, opacity, progress);
    const auto image = project(scan, view, opacity, progress);
    ASSERT_EQ(image.tau.size(), alone.size());
    for (std::size_t i = 0; i < alone.size(); ++i)
      // Coordinates are good to 1e-5 voxels, of which a ray crosses up to a hundred, and neighbours differ by
      // up to 0.05 per mm in this noise; a wrong voxel among them shows as 1e-2.
      ASSERT_NEAR(image.tau[i], alone[i], 5e-4)
          << opacity.name() << ", column " << i % static_cast<std::size_t>(view.width) << ", row "
          << i / static_cast<std::size_t>(view.width);
  }
}

/// Every block of a scan under an opacity, those above each other one after the other.
std::vector<XrcBlock> blocks_under(const Opacity& opacity, const ResidentScan& scan, std::size_t count) {
  std::vector<XrcBlock> blocks(count);
  const auto found = scan.constant_blocks(opacity);
  EXPECT_TRUE(found.has_value()) << "enough of them have one mu";
  if (found) device().download(*found, std::span(blocks));
  return blocks;
}

TEST(Plateaus, AreWhereAnOpacityHasOneMu) {
  const auto ranges = [](const Opacity& opacity) {
    const XrcPlateaus plateaus = plateaus_of(opacity);
    std::vector<std::pair<float, float>> found;
    for (int i = 0; i < plateaus.count; ++i) found.emplace_back(plateaus.from_hu[i], plateaus.to_hu[i]);
    return found;
  };
  using Ranges = std::vector<std::pair<float, float>>;
  constexpr float kAll_hu = 1e6f;
  EXPECT_EQ(ranges(Opacity("bone", {{-1000, 0}, {150, 0}, {1000, 0.06}})),
            (Ranges{{-kAll_hu, 150}, {1000, kAll_hu}}));
  EXPECT_EQ(ranges(Opacity("two", {{-900, 0.003}, {150, 0.003}, {400, 0.04}, {600, 0.04}, {700, 0}})),
            (Ranges{{-kAll_hu, 150}, {400, 600}, {700, kAll_hu}}));
  EXPECT_EQ(ranges(Opacity("even", {{0, 0.01}})), (Ranges{{-kAll_hu, kAll_hu}}));
}

TEST(ConstantBlocks, HaveOneMuEverywhere) {
  // Five blocks of 8 x 8 x 16 voxels in x, with what lies behind them. The first is soft tissue with noise,
  // the second has one bone, the third is all alike, the fourth has two values, and the last is dense.
  const Volume volume = make_volume({40, 8, 16}, {1, 1, 1}, [](const glm::dvec3& p) {
    const int x = static_cast<int>(std::lround(p.x + 19.5)), y = static_cast<int>(std::lround(p.y + 3.5));
    return x < 12 ? -20 + 10 * (y % 3) : x == 12 && y == 4 ? 700 : x < 25 ? 500 : 1500 + y;
  });
  const Opacity bone("bone", {{-1000, 0}, {150, 0}, {1000, 0.06}});
  const std::vector<XrcBlock> blocks = blocks_under(bone, upload(device(), volume), 5);
  EXPECT_EQ(blocks[0].mu, 0);
  EXPECT_FLOAT_EQ(blocks[2].mu, static_cast<float>(bone.mu_per_mm(500)));
  EXPECT_FLOAT_EQ(blocks[4].mu, 0.06f);
  std::vector<int> last;
  for (const XrcBlock& block : blocks) last.push_back(block.last);
  EXPECT_EQ(last, (std::vector<int>{0, -1, 0, -1, 0}));
}

TEST(ConstantBlocks, AreJoinedToThoseOfTheSameMuAboveThem) {
  // Two bricks of soft tissue, one with bones in it, one of soft tissue and three of fat.
  const Volume volume = make_volume({8, 8, 7 * 16}, {1, 1, 1}, [](const glm::dvec3& p) {
    const auto z = static_cast<int>(std::lround(p.z + 55.5));
    return z / 16 == 2 && z % 5 == 0 ? 700 : z < 64 ? 50 : -100;
  });
  const ResidentScan scan = upload(device(), volume);
  for (const Opacity& opacity : {Opacity::bilinear(), Opacity::paper(), Opacity::bilinear()}) {
    const std::vector<XrcBlock> blocks = blocks_under(opacity, scan, 7);
    std::vector<int> last;
    for (const XrcBlock& block : blocks) last.push_back(block.last);
    EXPECT_EQ(last, (std::vector<int>{1, 1, -1, 3, 6, 6, 6})) << opacity.name();
    EXPECT_FLOAT_EQ(blocks[0].mu, static_cast<float>(opacity.mu_per_mm(50)));
    EXPECT_FLOAT_EQ(blocks[6].mu, static_cast<float>(opacity.mu_per_mm(-100)));
  }
}

TEST(ConstantBlocks, AreNoneWhereFewHaveOneMu) {
  // 100 blocks, of which the first ones are air up to the voxels of the next, with which they are
  // interpolated.
  const auto are_found = [](int air_blocks) {
    const Volume volume = make_volume({80, 80, 16}, {1, 1, 1}, [&](const glm::dvec3& p) {
      return p.y < -30 && p.x < 8 * air_blocks - 39 ? -1000
                                                    : static_cast<int>(std::lround(p.x + 3 * p.y + 7 * p.z));
    });
    return upload(device(), volume).constant_blocks(Opacity::bilinear()).has_value();
  };
  EXPECT_FALSE(are_found(4));
  EXPECT_TRUE(are_found(5));  // one in twenty
}

TEST(ConstantBlocks, AreThoseOfTheScanThatIsLoaded) {
  const auto uniform = [](int hu) {
    return make_volume({8, 8, 32}, {1, 1, 1}, [=](const glm::dvec3&) { return hu; });
  };
  const Opacity opacity = Opacity::bilinear();
  ResidentScan scan = upload(device(), uniform(50));
  EXPECT_FLOAT_EQ(blocks_under(opacity, scan, 2)[0].mu, static_cast<float>(opacity.mu_per_mm(50)));
  const Volume next = uniform(500);
  scan.restart(next.geometry());
  scan.append(next.hu());
  EXPECT_FLOAT_EQ(blocks_under(opacity, scan, 2)[0].mu, static_cast<float>(opacity.mu_per_mm(500)));
}

/// Padding, soft tissue in which nothing is alike, and a few bones, whose edges lie anywhere in blocks.
Volume padded_body(const Index3& size, const glm::dvec3& spacing_mm) {
  std::mt19937 random(5);
  std::uniform_int_distribution<int> soft(-1000, 149), bone(150, 1500);
  const glm::dvec3 half_mm = 0.5 * glm::dvec3(size) * spacing_mm;
  return make_volume(size, spacing_mm, [&](const glm::dvec3& p) {
    const glm::dvec3 q = p / half_mm;
    if (glm::length(q - glm::dvec3(0.4, 0.1, 0.3)) < 0.25 || std::abs(q.x + 0.3) < 0.04) return bone(random);
    return glm::length(q) < 0.8 ? soft(random) : q.z > 0.7 ? -1000 : -1024;
  });
}

TEST_P(ProjectedPicture, IsTheSameWithConstantBlocksSkipped) {
  const auto& [size, spacing_mm, view] = GetParam();
  Progress progress;
  const ResidentScan scan = upload(device(), padded_body(size, spacing_mm));
  const Opacity bone("bone", {{-1000, 0}, {150, 0}, {1000, 0.06}}),
      plateaus("plateaus", {{-900, 0.003}, {150, 0.003}, {400, 0.04}, {600, 0.04}});
  for (const Opacity& opacity : {bone, plateaus, Opacity::bilinear(), Opacity::paper()}) {
    const auto skipped = project(scan, view, opacity, progress, {}, Sampling::skipping_constant_blocks),
               sampled = project(scan, view, opacity, progress, {}, Sampling::everywhere);
    const float largest = std::ranges::max(sampled.tau);
    for (std::size_t i = 0; i < sampled.tau.size(); ++i)
      // A millionth of the largest, and sums of a hundred 32-bit floats in another order.
      ASSERT_NEAR(skipped.tau[i], sampled.tau[i], 1e-6 * largest + 1e-9)
          << opacity.name() << ", column " << i % static_cast<std::size_t>(view.width) << ", row "
          << i / static_cast<std::size_t>(view.width);
  }
}

/// A picture of `width` x `height` pixels, without a cone where `source_axis_mm` is 0.
View picture(double angle_deg, double tilt_deg, double source_axis_mm, int width, int height,
             double pixel_mm) {
  View view{.lao_rad = angle_deg * kRadians,
            .cranial_rad = tilt_deg * kRadians,
            .width = width,
            .height = height,
            .pixel_mm = pixel_mm};
  if (source_axis_mm > 0) view.cone = Cone{source_axis_mm, 1.5 * source_axis_mm};
  return view;
}

std::vector<SeenScan> seen_scans() {
  std::vector<SeenScan> seen;
  const Index3 chest{61, 53, 75};
  const glm::dvec3 spacing_mm{1.5, 1.7, 2};
  for (const double tilt_deg : {0.0, -7.0, 20.0, 48.0, 85.0})
    for (const double angle_deg : {0.0, 30.0, 45.0, 90.0, 200.0, 287.0})
      for (const double source_axis_mm : {0.0, 400.0})
        seen.push_back({chest, spacing_mm, picture(angle_deg, tilt_deg, source_axis_mm, 45, 150, 1.8)});
  for (const double tilt_deg : {0.0, 25.0}) {
    // Rows from one to two slices apart.
    for (const double angle_deg : {10.0, 100.0})
      for (const double source_axis_mm : {0.0, 400.0})
        seen.push_back(
            {{40, 45, 90}, {1, 1, 0.8}, picture(angle_deg, tilt_deg, source_axis_mm, 31, 80, 1.5)});
    // The source inside the scan, and pixels much coarser and finer than slices.
    seen.push_back({chest, spacing_mm, picture(33, tilt_deg, 30, 41, 100, 1)});
    seen.push_back({chest, spacing_mm, picture(15, tilt_deg, 500, 20, 37, 9)});
    seen.push_back({chest, spacing_mm, picture(15, tilt_deg, 500, 20, 300, 0.1)});
    seen.push_back({{40, 30, 300}, {2, 2, 0.3}, picture(70, tilt_deg, 700, 33, 130, 1)});
    for (const Index3 size :
         {Index3{33, 17, 1}, {5, 4, 3}, {1, 1, 1}, {2, 40, 16}, {40, 1, 33}, {31, 31, 17}})
      for (const double source_axis_mm : {0.0, 300.0})
        seen.push_back({size, {1, 1.2, 1.4}, picture(20, tilt_deg, source_axis_mm, 37, 67, 0.9)});
  }
  return seen;
}

INSTANTIATE_TEST_SUITE_P(Project, ProjectedPicture, testing::ValuesIn(seen_scans()));

/// The Shepp-Logan head as voxels and in closed form, seen as RTK's test sees it: from 45 angles, on 64 x 64
/// pixels of 4 mm that are 1000 mm from the source.
class ProjectedSheppLogan : public testing::Test {
 protected:
  static View view(int i, double source_axis_mm) {
    return {.lao_rad = 8 * i * kRadians,
            .cone = Cone{source_axis_mm, 1000},
            .width = 64,
            .height = 64,
            .pixel_mm = 4};
  }

  /// `rays_at(i)` are the rays from angle i.
  static void expect_closed_form(const std::function<std::vector<RaySegment>(int i)>& rays_at) {
    std::vector<RaySegment> rays;
    for (int i = 0; i < 45; ++i) std::ranges::copy(rays_at(i), std::back_inserter(rays));
    std::vector<Ellipsoid> ellipsoids;
    for (const auto& [centre_mm, half_axes_mm, turn_rad, density] : shepp_logan_ellipsoids())
      ellipsoids.push_back({centre_mm, half_axes_mm, turn_rad, density});
    std::vector<double> expected;
    for (const RaySegment& ray : rays)
      expected.push_back(ellipsoids_line_integral(ray.start_mm, ray.end_mm, ellipsoids));
    // RTK projects densities, and its bars are for their sums over mm. The head's HU are 1024 (density - 1);
    // with this opacity mu is the density again, per mm.
    const Opacity densities("densities", {{-1024, 0}, {1024, 2}});
    Progress progress;
    const Volume volume = generate(make_phantom("shepp-logan"), device(), progress);
    expect_rtk_bars(project_rays(volume, rays, densities), expected);
  }
};

TEST_F(ProjectedSheppLogan, MatchesItsLineIntegralsOnAFlatDetector) {
  expect_closed_form([](int i) { return rays_of(view(i, 500)); });
}

TEST_F(ProjectedSheppLogan, MatchesItsLineIntegralsFromASourceInsideTheScan) {
  expect_closed_form([](int i) { return rays_of(view(i, 120)); });
}

TEST_F(ProjectedSheppLogan, MatchesItsLineIntegralsOnACylindricalDetector) {
  expect_closed_form([](int i) {
    // Upright, and it touches the flat detector in its middle.
    constexpr double kRadius_mm = 600;
    const View flat = view(i, 500);
    const glm::dvec3 axis_mm = flat.centre_mm + (500 - kRadius_mm) * flat.towards_detector();
    std::vector<RaySegment> rays;
    for (int row = 0; row < flat.height; ++row)
      for (int column = 0; column < flat.width; ++column) {
        const double arc_rad = (column + 0.5 - 0.5 * flat.width) * flat.pixel_mm / kRadius_mm;
        const double height_mm = (0.5 * flat.height - row - 0.5) * flat.pixel_mm;
        const glm::dvec3 outwards =
            std::cos(arc_rad) * flat.towards_detector() + std::sin(arc_rad) * flat.right();
        rays.push_back({flat.source_mm(), axis_mm + kRadius_mm * outwards + height_mm * flat.up()});
      }
    return rays;
  });
}

TEST(ProjectedRays, FromImagesAreTheSame) {
  if (!device().self_test().images) GTEST_SKIP() << "the device has no usable images";
  const Volume volume = make_volume({50, 60, 37}, {2, 1.5, 2.5},
                                    [](const glm::dvec3& p) { return 10 * p.x - 7 * p.y + p.z * p.z / 9; });
  const auto rays = rays_of(cone_view(33, 12, {700, 1000}));
  const auto bricks = project_rays(volume, rays),
             images = project_rays(volume, rays, lengths(), ScanStorage::image);
  // As nanodrr compares its back ends.
  for (std::size_t i = 0; i < rays.size(); ++i)
    ASSERT_NEAR(images[i], bricks[i], 1e-4 * *std::ranges::max_element(bricks));
}

/// 1 within [first, last], falling linearly to 0 over one voxel on both sides: an interpolated row of ones.
double trapezoid(double x, double first, double last) {
  return std::clamp(std::min(x - first + 1, last + 1 - x), 0.0, 1.0);
}

// The integral, along a ray, of a box of ones between voxels `lower` and `upper` of a grid of unit voxels
// that interpolates linearly across the ray's dominant axis: written from the definition, without any voxels.
double interpolated_box_integral(const glm::dvec3& a, const glm::dvec3& b, const Index3& lower,
                                 const Index3& upper) {
  const glm::dvec3 d = b - a, extent = glm::abs(d);
  const int axis = extent.x >= extent.y && extent.x >= extent.z ? 0 : extent.y >= extent.z ? 1 : 2;
  double sum = 0;
  for (std::int64_t k = lower[axis]; k <= upper[axis]; ++k) {
    const double t = (static_cast<double>(k) - a[axis]) / d[axis];
    double weight = 1;
    for (int other = 0; other < 3; ++other)
      if (other != axis)
        weight *= trapezoid(a[other] + t * d[other], static_cast<double>(lower[other]),
                            static_cast<double>(upper[other]));
    sum += weight;
  }
  return sum * glm::length(d) / extent[axis];
}

TEST(ProjectedRays, MatchTheExactIntegralsOfRandomBoxes) {
  std::mt19937 random(50);
  const auto integer = [&](std::int64_t low, std::int64_t high) {
    return std::uniform_int_distribution<std::int64_t>(low, high)(random);
  };
  const auto real = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  constexpr std::int64_t kSize = 48;
  for (int box = 0; box < 50; ++box) {
    Index3 lower, upper;
    for (int axis = 0; axis < 3; ++axis) {
      lower[axis] = integer(2, kSize - 3);  // clear of the border, where the ray is clipped between planes
      upper[axis] = integer(lower[axis], kSize - 3);
    }
    const VolumeGeometry geometry = centred_geometry({kSize, kSize, kSize}, {1, 1, 1});
    const Volume volume = make_volume(geometry.size, geometry.spacing_mm, [&](const glm::dvec3& p) {
      const Index3 voxel(glm::round(geometry.to_index(p)));
      return glm::all(glm::greaterThanEqual(voxel, lower)) && glm::all(glm::lessThanEqual(voxel, upper))
                 ? 0
                 : -1024;
    });
    std::vector<RaySegment> rays;
    for (int i = 0; i < 200; ++i) {
      const glm::dvec3 through(real(-24, 24), real(-24, 24), real(-24, 24));
      const double phi = real(0, 2 * std::numbers::pi), cosine = real(-1, 1),
                   sine = std::sqrt(1 - cosine * cosine);
      const glm::dvec3 direction(sine * std::cos(phi), sine * std::sin(phi), cosine);
      rays.push_back({through - 100.0 * direction, through + 100.0 * direction});
    }
    const auto tau = project_rays(volume, rays);
    for (std::size_t i = 0; i < rays.size(); ++i)
      // ASTRA's bar for its linear kernels, in voxels.
      ASSERT_NEAR(tau[i],
                  interpolated_box_integral(geometry.to_index(rays[i].start_mm),
                                            geometry.to_index(rays[i].end_mm), lower, upper),
                  2e-3)
          << "box " << box << ", ray " << i;
  }
}

TEST(ProjectedRays, ThroughASingleVoxelIntegrateToItsLength) {
  Volume volume = make_volume({9, 9, 9}, {1, 1, 1}, [](const glm::dvec3&) { return -1024; });
  volume.at(4, 4, 4) = 0;
  const std::vector<RaySegment> rays{
      {{-50, 0, 0}, {50, 0, 0}}, {{0, 50, 0}, {0, -50, 0}}, {{0, 0, -50}, {0, 0, 50}}};
  // nanodrr's bar.
  for (const float tau : project_rays(volume, rays)) EXPECT_NEAR(tau, 1, 1e-3);
}

TEST(ProjectedRays, ThatAreNotFiniteAreRefused) {
  const Volume volume = make_volume({4, 4, 4}, {1, 1, 1}, [](const glm::dvec3&) { return 0; });
  const double nan = std::nan(""), infinity = std::numeric_limits<double>::infinity();
  for (const double bad : {nan, infinity, 1e30})
    EXPECT_THROW(project_rays(volume, std::vector<RaySegment>{{{bad, 0, 0}, {1, 0, 0}}}), InputError);
}

/// Ends the process with 0 when all of the odd rays below give finite values.
void project_odd_rays() {
  alarm(60);  // a hang ends the process with a signal
  const Volume volume = make_volume({16, 12, 10}, {1, 2, 3}, [](const glm::dvec3& p) { return 100 * p.x; });
  const Box extent = scan_extent(volume.geometry());
  std::vector<RaySegment> rays{{{500, 500, 500}, {600, 500, 500}},     // misses
                               {{0, 0, 0}, {0, 0, 0}},                 // no length
                               {{-100, 0, 0}, {100, 0, 0}},            // along an axis
                               {{-100, 1e-9, 0}, {100, -1e-9, 1e-9}},  // almost
                               {{0, 0, -1e5}, {1e-7, 0, 1e5}}};
  for (const double x : {extent.lower_mm.x, extent.upper_mm.x})  // grazes edges and corners
    for (const double y : {extent.lower_mm.y, extent.upper_mm.y})
      for (const double z : {extent.lower_mm.z, extent.upper_mm.z}) {
        rays.push_back({{x, y, -100}, {x, y, 100}});
        rays.push_back({{-100, y, z}, {100, y, z}});
        rays.push_back({{x, -100, z}, {x, 100, z}});
        rays.push_back({{x - 50, y + 50, z}, {x + 50, y - 50, z}});
      }
  const auto finite = [](float tau) { return std::isfinite(tau) && tau >= 0; };
  bool ok = std::ranges::all_of(project_rays(volume, rays), finite);
  Progress progress;
  const ResidentScan scan = upload(device(), volume);
  for (const auto& [width, height] :
       {std::pair{1, 1}, std::pair{7, 3}, std::pair{1, 257}, std::pair{1023, 5}})
    for (const bool cone : {false, true}) {
      View view{.lao_rad = 0.3, .width = width, .height = height, .pixel_mm = 1};
      if (cone) view.cone = Cone{100, 150};
      ok = ok && std::ranges::all_of(project(scan, view, lengths(), progress).tau, finite);
    }
  std::_Exit(ok ? 0 : 1);
}

TEST(ProjectedRays, OddOnesEndInTimeWithFiniteValues) {
  GTEST_FLAG_SET(death_test_style,
                 "threadsafe");  // a new process: the driver's threads do not survive a fork
  EXPECT_EXIT(project_odd_rays(), testing::ExitedWithCode(0), "");
}

}  // namespace
}  // namespace xraycast::test::projector_cl_test
