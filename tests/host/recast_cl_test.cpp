#include "support/reference.hpp"
#include "support/shared_device.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/casting/caster.hpp"
#include "xraycast/casting/recast.hpp"
#include "xraycast/phantom/phantom.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>

namespace xraycast::test::recast_cl_test {
namespace {

// Of the map's largest value. What the weights' rounding costs is bounded test by test; this is for the
// floats that a cold cast sums up, as in caster_cl_test.
constexpr double kFloat = 1e-5;

struct Case {
  const char* name;
  Volume (*volume)();
  int angles, layers;
};

Volume texture() { return textured_volume({60, 50, 20}, {1, 1, 2}); }
Volume thorax() {
  Progress progress;
  return generate(make_phantom("thorax", {.size = Index3(96, 96, 75)}), device(), progress);
}

MapGeometry geometry_of(const Volume& volume, int angles, int layers) {
  // Beyond the slice's nearest edge, off its centre, and with edges that cut samples.
  const double radius_mm =
      0.55 * volume.geometry().spacing_mm.x * static_cast<double>(volume.geometry().size.x);
  return cylinder_map(volume.geometry(), angles, shell_radii_mm(RadiiRule::equal_area, layers, radius_mm),
                      {1.3, -0.8});
}

std::vector<double> random_knots_hu(std::mt19937& random, std::size_t count) {
  std::vector<double> all(3000), knots;
  std::iota(all.begin(), all.end(), kPaddingHu);
  std::ranges::sample(all, std::back_inserter(knots), static_cast<std::ptrdiff_t>(count), random);
  return knots;
}

/// On all of the knots, or on some of them.
Opacity random_opacity(std::mt19937& random, std::span<const double> knots_hu) {
  std::uniform_real_distribution<double> mu(0, 0.06);
  std::vector<Opacity::Knot> knots;
  const auto sparsity = 1 + random() % 3;
  for (const double hu : knots_hu)
    if (random() % sparsity == 0) knots.push_back({hu, mu(random)});
  if (knots.empty()) knots.push_back({knots_hu[random() % knots_hu.size()], mu(random)});
  return {"random", knots};
}

/// What rounding the weights may change in any texel (see Basis).
double rounding_of(const MapGeometry& geometry, const Opacity& opacity) {
  double variation = 0, thickness_mm = 0;
  for (std::size_t i = 1; i < opacity.knots().size(); ++i)
    variation += std::abs(opacity.knots()[i].mu_per_mm - opacity.knots()[i - 1].mu_per_mm);
  for (std::size_t k = 1; k < geometry.radii_mm.size(); ++k)
    thickness_mm = std::max(thickness_mm, geometry.radii_mm[k] - geometry.radii_mm[k - 1]);
  return thickness_mm / 131070 * variation;
}

double largest_difference(std::span<const float> a, std::span<const float> b) {
  double largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i)
    largest = std::max(largest, std::abs(double{a[i]} - double{b[i]}));
  return largest;
}

void expect_same(const BodyMap& recast, const BodyMap& cast) {
  ASSERT_EQ(recast.tau.size(), cast.tau.size());
  const double deepest = *std::ranges::max_element(cast.tau),
               difference = largest_difference(recast.tau, cast.tau);
  EXPECT_LE(difference, rounding_of(cast.geometry, cast.opacity()) + kFloat * deepest);
  // What was promised whatever the opacity.
  EXPECT_LE(difference, 1e-3 * deepest);
}

class Recast : public testing::TestWithParam<Case> {
 protected:
  static void SetUpTestSuite() {
    ASSERT_FALSE(ComputeDevice::list().empty()) << "these tests need an OpenCL device, such as PoCL";
  }
};

TEST(RecastUnderAnOutline, EqualsAColdCast) {
  const Volume volume = texture();
  const ResidentScan scan = upload(device(), volume);
  const MapGeometry circles = geometry_of(volume, 60, 5);
  std::mt19937 random(5);
  Progress progress;
  for (const int rows : {1, circles.height}) {
    std::vector<float> outline_mm;
    for (int i = 0; i < rows * circles.width; ++i)
      outline_mm.push_back(static_cast<float>(25 + 5 * std::sin(0.21 * i)));
    const MapGeometry geometry = with_outline(circles, outline_mm);
    const auto knots_hu = random_knots_hu(random, 20);
    RecastSession session(device(), make_basis(scan, geometry, knots_hu, progress));
    for (int i = 0; i < 5; ++i) {
      const Opacity opacity = random_opacity(random, knots_hu);
      expect_same(session.recast(opacity), cast(scan, geometry, opacity, progress).map);
    }
  }
}

TEST_P(Recast, EqualsAColdCast) {
  const Volume volume = GetParam().volume();
  const ResidentScan scan = upload(device(), volume);
  const MapGeometry geometry = geometry_of(volume, GetParam().angles, GetParam().layers);
  std::mt19937 random(5);
  Progress progress;
  for (const std::size_t knots : {64, 20, 3, 1}) {
    const auto knots_hu = random_knots_hu(random, knots);
    RecastSession session(device(), make_basis(scan, geometry, knots_hu, progress));
    for (int i = 0; i < 50; ++i) {
      const Opacity opacity = random_opacity(random, knots_hu);
      SCOPED_TRACE(opacity.to_json());
      const BodyMap& map = session.recast(opacity);
      expect_same(map, cast(scan, geometry, opacity, progress).map);
      EXPECT_EQ(map.opacity(), opacity);
    }
  }
}

TEST_P(Recast, OfImagesIsTheSame) {
  if (!device().self_test().images) GTEST_SKIP() << "the device has no usable images";
  const Volume volume = GetParam().volume();
  const MapGeometry geometry = geometry_of(volume, GetParam().angles, GetParam().layers);
  const auto knots_hu = useful_knots_hu(Opacity::bilinear());
  Progress progress;
  const ResidentScan bricks = upload(device(), volume, ScanStorage::bricks),
                     image = upload(device(), volume, ScanStorage::image);
  const Basis of_bricks = make_basis(bricks, geometry, knots_hu, progress),
              of_image = make_basis(image, geometry, knots_hu, progress);
  EXPECT_EQ(of_image.hu_histogram, of_bricks.hu_histogram);
  RecastSession session(device(), of_image);
  expect_same(session.recast(Opacity::bilinear()), cast(bricks, geometry, Opacity::bilinear(), progress).map);
}

INSTANTIATE_TEST_SUITE_P(Basis, Recast,
                         testing::Values(Case{"Texture1", texture, 77, 1}, Case{"Texture4", texture, 77, 4},
                                         Case{"Texture8", texture, 77, 8}, Case{"Texture16", texture, 77, 16},
                                         Case{"Thorax1", thorax, 120, 1}, Case{"Thorax4", thorax, 120, 4},
                                         Case{"Thorax8", thorax, 120, 8}, Case{"Thorax16", thorax, 120, 16}),
                         [](const auto& c) { return c.param.name; });

/// One small scan and its basis.
class RecastKnots : public testing::Test {
 protected:
  const Volume volume = texture();
  const ResidentScan scan = upload(device(), volume);
  const MapGeometry geometry = geometry_of(volume, 77, 8);
  Progress progress;
  Basis basis = make_basis(scan, geometry, {-1000, -300, 0, 40, 300, 1200}, progress);
};

TEST_F(RecastKnots, WeightsOfATexelAddUpToItsShell) {
  std::size_t row = 0;
  for (std::size_t tile = 0; tile < basis.touched.size(); ++tile) {
    std::array<int, 16> sum{};
    for (int left = std::popcount(basis.touched[tile]); left > 0; --left)
      for (int& lane : sum) lane += basis.weights[row++];
    // 20 slices: the second brick holds 4.
    const std::size_t slices = tile < basis.touched.size() / 2 ? 16 : 4;
    for (std::size_t s = 0; s < 16; ++s) ASSERT_EQ(sum[s], s < slices ? 65535 : 0) << "tile " << tile;
  }
  EXPECT_EQ(row, basis.weights.size());
}

TEST_F(RecastKnots, AConstantOpacityIsExact) {
  RecastSession session(device(), basis);
  const BodyMap& map = session.recast(Opacity("constant", {{40, 0.03}}));
  for (std::size_t i = 0; i < map.tau.size(); ++i) {
    const std::size_t k = i / map.layer_size();
    const double tau = 0.03 * (geometry.radii_mm[k + 1] - geometry.radii_mm[k]);
    // Six products of 24-bit floats.
    ASSERT_NEAR(map.tau[i], tau, 1e-6 * tau);
  }
}

TEST_F(RecastKnots, AirMayAttenuate) {
  RecastSession session(device(), basis);
  const Opacity opacity("air", {{-1000, 0.04}, {0, 0.01}, {1200, 0.03}});
  expect_same(session.recast(opacity), cast(scan, geometry, opacity, progress).map);
}

TEST_F(RecastKnots, ServeACentreLine) {
  std::vector<glm::dvec2> centre_mm;
  for (int row = 0; row < geometry.height; ++row) centre_mm.emplace_back(0.4 * row - 3, 2 - 0.3 * row);
  const MapGeometry winding = cylinder_map(volume.geometry(), 77, geometry.radii_mm, centre_mm);
  RecastSession session(device(), make_basis(scan, winding, basis.knots_hu, progress));
  const Opacity opacity("air", {{-1000, 0.04}, {0, 0.01}, {1200, 0.03}});
  expect_same(session.recast(opacity), cast(scan, winding, opacity, progress).map);
}

TEST_F(RecastKnots, MayLieWithinOneHu) {
  const std::vector<double> knots_hu{-0.75, -0.5, 0.125, 0.25, 0.5, 17.5, 32767};
  RecastSession session(device(), make_basis(scan, geometry, knots_hu, progress));
  // Few and gentle enough for a cold cast to add up ramps, which are exact between whole HU.
  for (const Opacity& opacity : {Opacity("two", {{-0.75, 0.01}, {32767, 0.05}}),
                                 Opacity("three", {{0.25, 0.02}, {0.5, 0.0201}, {17.5, 0.022}})})
    expect_same(session.recast(opacity), cast(scan, geometry, opacity, progress).map);
}

TEST_F(RecastKnots, HistogramCountsEveryFourthRowAndColumn) {
  std::vector<std::int64_t> expected(256, 0);
  for (std::int64_t z = 0; z < 20; ++z)
    for (std::int64_t y = 0; y < 50; y += 4)
      for (std::int64_t x = 0; x < 60; x += 4) ++expected[std::min((volume.at(x, y, z) + 1024) / 16, 255)];
  EXPECT_EQ(basis.hu_histogram, expected);
}

struct BadOpacity {
  std::vector<Opacity::Knot> knots;
  const char* message;
};

TEST_F(RecastKnots, OthersThanTheBasisAreNamed) {
  RecastSession session(device(), basis);
  for (const auto& [knots, message] :
       {BadOpacity{{{-1000, 0}, {100, 0.02}, {300, 0.03}},
                   "knots[1] at 100 HU is not a knot of the basis; the "
                   "nearest are at 40 and 300 HU"},
        BadOpacity{{{-1024, 0}, {0, 0.02}},
                   "knots[0] at -1024 HU is not a knot of the basis; the first is at "
                   "-1000 HU"},
        BadOpacity{{{0, 0}, {1200.5, 0.02}},
                   "knots[1] at 1200.5 HU is not a knot of the basis; the last is at "
                   "1200 HU"}}) {
    try {
      session.recast(Opacity("bad", knots));
      ADD_FAILURE() << "accepted: " << message;
    } catch (const InputError& error) {
      EXPECT_STREQ(error.what(), (std::string("opacity bad: ") + message).c_str());
    }
  }
}

TEST_F(RecastKnots, ThatMakeNoBasisAreRefused) {
  const std::vector<double> too_many = [] {
    std::vector<double> knots(65);
    std::iota(knots.begin(), knots.end(), 0);
    return knots;
  }();
  for (const auto& knots_hu :
       {std::vector<double>{}, too_many, {0, 0}, {3, 2}, {-1025}, {32768}, {NAN}, {1000, 1000 + 1e-9}})
    EXPECT_THROW(make_basis(scan, geometry, knots_hu, progress), InputError);
}

TEST(UsefulKnots, HoldTheOpacitysAndTheUsualOnesWhileThereIsRoom) {
  const auto paper = useful_knots_hu(Opacity::paper());
  EXPECT_THAT(paper, testing::IsSupersetOf({-1024.0, 0.0, 1000.0, 32767.0}));
  EXPECT_GT(paper.size(), 30);
  std::vector<Opacity::Knot> knots;
  for (int i = 0; i < 64; ++i) knots.push_back({3.0 + 7 * i, 0.01});
  EXPECT_EQ(useful_knots_hu(Opacity("full", knots)).size(), 64);
}

}  // namespace
}  // namespace xraycast::test::recast_cl_test
