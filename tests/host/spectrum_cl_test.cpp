#include "support/reference.hpp"
#include "support/shared_device.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/casting/spectral_scan.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace xraycast::test::spectrum_cl_test {
namespace {

constexpr std::size_t kWater = 0, kBone = 1, kIodine = 2;

// A ray adds up some hundred products of 24-bit floats.
constexpr double kFloat = 1e-5;

/// The contents of a voxel, in g/cm3.
std::array<double, kMaterials.size()> g_cm3(double native_hu, double enhancement_hu = 0) {
  const auto contents = material_contents();
  return {10 * contents[kWater].mu_per_mm(native_hu), 10 * contents[kBone].mu_per_mm(native_hu),
          10 * contents[kIodine].mu_per_mm(enhancement_hu)};
}

Volume homogeneous(int hu) {
  return make_volume({64, 64, 18}, {1, 1, 1}, [hu](const glm::dvec3&) { return hu; });
}

BodyMap cast_map(const SpectralScan& scan, const std::vector<double>& radii_mm, const Spectrum& spectrum) {
  Progress progress;
  return cast(scan, cylinder_map(scan.native.geometry(), 90, radii_mm, {0, 0}), spectrum, progress).map;
}

/// A scan and its vessels through the same door as the command line's.
SpectralScan load_scan(const Volume& scan, const Volume& vessels) {
  Progress progress;
  VolumeSource scan_source(scan), vessel_source(vessels);
  OutlineFinder finder(scan.geometry());
  LoadTimings timings;
  return load(device(), scan_source, vessel_source, finder, timings, progress);
}

class SpectrumMap : public testing::TestWithParam<int> {};

TEST_P(SpectrumMap, OfHomogeneousMatterIsDensityTimesThickness) {
  const std::vector<double> radii_mm{0, 7.5, 19, 30};
  const SpectralScan scan{upload(device(), homogeneous(GetParam())), {}};
  const BodyMap map = cast_map(scan, radii_mm, Spectrum::named("100"));
  const auto density = g_cm3(GetParam());
  for (std::size_t m = 0; m < kMaterials.size(); ++m)
    for (std::size_t i = 0; i < map.depths[m].size(); ++i) {
      const std::size_t layer = i / map.layer_size();
      const double thickness_cm = 0.1 * (radii_mm[layer + 1] - radii_mm[layer]);
      ASSERT_NEAR(map.depths[m][i], density[m] * thickness_cm, kFloat * 3) << kMaterials[m].name << ' ' << i;
    }
}

INSTANTIATE_TEST_SUITE_P(Hu, SpectrumMap, testing::Values(-1024, -700, 0, 60, 400, 1200, 3000));

TEST(SpectrumMapLayers, AddUpInMassButNotInOpticalDepth) {
  const Volume volume = make_volume({64, 64, 18}, {1, 1, 1}, [](const glm::dvec3& p) {
    return 300 + 40 * p.x * std::sin(p.y / 7) + 20 * p.z;
  });
  const SpectralScan scan{upload(device(), volume), {}};
  const Spectrum spectrum = Spectrum::named("80");
  const BodyMap layered = cast_map(scan, {0, 10, 20, 30}, spectrum),
                single = cast_map(scan, {0, 30}, spectrum);
  const auto sum_of_layers = [&](const std::vector<float>& layers) {
    std::vector<double> sum(single.layer_size());
    for (std::size_t i = 0; i < layers.size(); ++i) sum[i % sum.size()] += layers[i];
    return sum;
  };
  for (const std::size_t m : {kWater, kBone}) {
    const auto sum = sum_of_layers(layered.depths[m]);
    for (std::size_t i = 0; i < sum.size(); ++i) ASSERT_NEAR(sum[i], single.depths[m][i], kFloat * 5);
  }
  const SpectrumModel model(spectrum);
  const auto tau = model.tau(single.depths);
  const auto sum_of_tau = sum_of_layers(model.tau(layered.depths));
  for (std::size_t i = 0; i < tau.size(); ++i) {
    EXPECT_GT(sum_of_tau[i], tau[i]);
    // Shells of a centimetre each see the unhardened beam: some per cent, far above rounding.
    if (single.depths[kBone][i] > 1) {
      EXPECT_GT(sum_of_tau[i], 1.02 * tau[i]);
    }
  }
}

TEST(SpectrumProjection, OfTwoSlabsMatchesItsClosedForm) {
  // Water in front, dense bone behind; rays run along y, through whole voxels.
  const Volume volume = make_volume({20, 60, 20}, {2, 1, 2}, [](const glm::dvec3& p) {
    return p.y < -20 ? -1024 : p.y < 10 ? 0 : 1200;
  });
  const auto count = [&](int hu) {
    int voxels = 0;
    for (std::int64_t y = 0; y < 60; ++y) voxels += volume.at(10, y, 10) == hu;
    return voxels;
  };
  const auto water = g_cm3(0), bone = g_cm3(1200);
  std::array<double, kMaterials.size()> g_cm2{};
  for (std::size_t m = 0; m < g_cm2.size(); ++m)
    g_cm2[m] = 0.1 * (count(0) * water[m] + count(1200) * bone[m]);
  View view{.width = 5, .height = 5, .pixel_mm = 2};
  view.centre_mm = {0, 0, 0};
  for (const char* kvp : {"80", "120"}) {
    const Spectrum spectrum = Spectrum::named(kvp);
    Progress progress;
    const auto image = project({upload(device(), volume), {}}, view, spectrum, progress);
    const double expected = -std::log(SpectrumModel(spectrum).transmission(g_cm2));
    for (const float tau : image.tau) EXPECT_NEAR(tau, expected, kFloat * expected) << kvp;
  }
}

// A vessel of 8 x 8 mm along z with 400 HU in muscle of 60 HU, and its mask.
struct Vessel {
  Volume scan =
      make_volume({48, 48, 16}, {1, 1, 1}, [](const glm::dvec3& p) { return inside(p) ? 400 : 60; });
  Volume mask = make_volume({48, 48, 16}, {1, 1, 1}, [](const glm::dvec3& p) { return inside(p); });
  static bool inside(const glm::dvec3& p) { return std::abs(p.x) < 3.6 && std::abs(p.y) < 3.6; }
};

TEST(Iodine, IsCountedWholeUpToTheMasksBorder) {
  const Vessel vessel;
  const SpectralScan scan = load_scan(vessel.scan, vessel.mask);
  View view{.width = 33, .height = 1, .pixel_mm = 1};
  Progress progress;
  const auto iodine = project(*scan.contrast, view, material_contents()[kIodine], progress);
  // Eight voxels of 400 - 45 HU; interpolation spreads the border's over two pixels, and loses none.
  double sum_mm = 0;
  for (const float g_cm2 : iodine.tau) sum_mm += g_cm2 / g_cm3(0, 355)[kIodine] * 10;
  EXPECT_NEAR(sum_mm, 8 * 8, 1e-3);  // rounding of voxel coordinates
}

TEST(Iodine, IsBoneWithoutAMask) {
  const Vessel vessel;
  const Spectrum spectrum = Spectrum::named("80");
  const SpectralScan masked = load_scan(vessel.scan, vessel.mask), plain{upload(device(), vessel.scan), {}};
  const auto largest = [](const std::vector<float>& values) { return *std::ranges::max_element(values); };
  const BodyMap with = cast_map(masked, {0, 20}, spectrum), without = cast_map(plain, {0, 20}, spectrum);
  EXPECT_EQ(largest(without.depths[kIodine]), 0);
  EXPECT_GT(largest(without.depths[kBone]), 0.05);
  EXPECT_EQ(largest(with.depths[kBone]), 0);
  // Half the vessel, 4 mm of 355 HU, is on every ray's way, and up to sqrt(2) of that.
  const double half_g_cm2 = 0.4 * g_cm3(0, 355)[kIodine];
  for (const float g_cm2 : with.depths[kIodine]) {
    EXPECT_GT(g_cm2, 0.99 * half_g_cm2);
    EXPECT_LT(g_cm2, 1.5 * half_g_cm2);
  }
}

TEST(Iodine, ChangesNothingAtTheScannersEnergy) {
  // What was 70 keV in the scan attenuates as before however it is split, across the mask's border too.
  const Vessel vessel;
  const Spectrum line("70 keV", {{70, 1}});
  const View view{.lao_rad = 0.3, .width = 31, .height = 9, .pixel_mm = 1};
  Progress progress;
  const auto masked = project(load_scan(vessel.scan, vessel.mask), view, line, progress),
             plain = project({upload(device(), vessel.scan), {}}, view, line, progress);
  for (std::size_t i = 0; i < masked.tau.size(); ++i) ASSERT_NEAR(masked.tau[i], plain.tau[i], 1e-5) << i;
}

TEST(Iodine, NeedsAMaskOnTheScansGrid) {
  const Vessel vessel;
  const Volume other = make_volume({24, 24, 16}, {2, 2, 1}, [](const glm::dvec3&) { return 1; });
  EXPECT_THROW(load_scan(vessel.scan, other), InputError);
}

}  // namespace
}  // namespace xraycast::test::spectrum_cl_test
