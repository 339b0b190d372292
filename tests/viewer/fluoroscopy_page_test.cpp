// The table "Measured" of docs/fluoroscopy.md: with other values here the page must change too.
#include "support/scan_files.hpp"
#include "xraycast/attenuation/materials.hpp"
#include "xraycast/fluoroscope/fluoroscope.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace xraycast::fluoroscopy_page_test {
namespace {

using ::testing::HasSubstr;

constexpr int kSide = 256;
constexpr double kPixel_mm = 0.308;
constexpr Cone kDistances{785, 1200};

/// The iodine in g/cm2 of an upright vessel of 1 mm at the isocentre, as a column of pixels sees it.
double iodine_in_column(int column) {
  constexpr double kRadius_mm = 0.5, kIodine_g_cm3 = 0.35, kCm_per_mm = 0.1;
  constexpr int kSamples = 16;
  const double magnification = kDistances.source_detector_mm / kDistances.source_axis_mm;
  double chord_mm = 0;
  for (int sample = 0; sample < kSamples; ++sample) {
    const double x_mm = (column + (sample + 0.5) / kSamples - 0.5 * kSide) * kPixel_mm / magnification;
    chord_mm += 2 * std::sqrt(std::max(0.0, kRadius_mm * kRadius_mm - x_mm * x_mm)) / kSamples;
  }
  return kIodine_g_cm3 * kCm_per_mm * chord_mm;
}

/// A slab of water with the vessel down its middle.
MaterialDepths slab_with_vessel(double water_cm) {
  MaterialDepths g_cm2;
  for (auto& material : g_cm2) material.assign(std::size_t{kSide} * kSide, 0);
  std::ranges::fill(g_cm2[0], static_cast<float>(water_cm));
  for (std::size_t pixel = 0; pixel < g_cm2[2].size(); ++pixel)
    g_cm2[2][pixel] = static_cast<float>(iodine_in_column(static_cast<int>(pixel % kSide)));
  return g_cm2;
}

struct Property {
  double kerma_mGy_min = 0, mottle = 0, contrast = 0;
  Technique technique;
};

struct MeanAndSpread {
  double mean = 0, spread = 0;
};

/// Of some columns.
MeanAndSpread statistics_of(const std::vector<float>& picture, int first, int end) {
  double sum = 0, squares = 0, count = 0;
  for (int pixel = 0; pixel < kSide * kSide; ++pixel) {
    if (pixel % kSide < first || pixel % kSide >= end) continue;
    const double value = picture[static_cast<std::size_t>(pixel)];
    sum += value;
    squares += value * value;
    ++count;
  }
  return {sum / count, std::sqrt(squares / count - sum / count * sum / count)};
}

/// A pulse of the field of 22 cm.
Property measured(DoseLevel dose, double water_cm) {
  FluoroscopyOptions options;
  options.c_arm = CArm::named("fixed-single-plane");
  options.field_mm = 220;
  options.dose = dose;
  const View view{.cone = kDistances, .width = kSide, .height = kSide, .pixel_mm = kPixel_mm};
  constexpr double kTau_per_cm = 0.2;
  Fluoroscope fluoroscope(options, view, WaterPath(Opacity("water", {{-1000, 0}, {0, 0.1 * kTau_per_cm}})));
  const std::vector<float> slab(std::size_t{kSide} * kSide, static_cast<float>(kTau_per_cm * water_cm));
  fluoroscope.settle(slab);
  const double kerma_rate = fluoroscope.kerma_rate_mGy_min();
  const MaterialDepths with_vessel = slab_with_vessel(water_cm);
  const RayMasses rays{with_vessel};
  const FluoroscopyFrame& frame = fluoroscope.expose(&rays);
  const MeanAndSpread beside = statistics_of(frame.signal_kev, 20, 100);
  const MeanAndSpread vessel = statistics_of(frame.signal_kev, kSide / 2 - 1, kSide / 2 + 1);
  return {kerma_rate, beside.spread / beside.mean, 1 - vessel.mean / beside.mean, frame.technique};
}

std::string page() { return read_bytes(XRAYCAST_SOURCE_DIR "/docs/fluoroscopy.md"); }

TEST(FluoroscopyPage, AirKermaRatesAndTechniqueAreThoseOfThePage) {
  EXPECT_THAT(page(),
              HasSubstr("| air kerma rate, 20 cm of water: low, normal, cine | 9.6, 19.2, 96 mGy/min |"));
  EXPECT_THAT(page(), HasSubstr("| the same, 30 cm | 50, 100, 434 mGy/min |"));
  EXPECT_THAT(page(), HasSubstr("| technique at 20 cm, normal | 76 kVp, 0.57 mAs |"));
  struct Row {
    DoseLevel dose;
    double mGy_min_20_cm, mGy_min_30_cm;
  };
  for (const Row& row :
       {Row{DoseLevel::low, 9.6, 50}, Row{DoseLevel::normal, 19.2, 100}, Row{DoseLevel::cine, 96, 434}}) {
    // What the page's rounding leaves, to two figures.
    EXPECT_NEAR(measured(row.dose, 20).kerma_mGy_min / row.mGy_min_20_cm, 1, 0.01);
    EXPECT_NEAR(measured(row.dose, 30).kerma_mGy_min / row.mGy_min_30_cm, 1, 0.01);
  }
  const Technique technique = measured(DoseLevel::normal, 20).technique;
  EXPECT_EQ(technique.kvp, 76);
  EXPECT_NEAR(technique.mas, 0.57, 0.006);
}

TEST(FluoroscopyPage, MottleAndContrastOfAVesselAreThoseOfThePage) {
  EXPECT_THAT(page(), HasSubstr("| mottle of a pixel, 20 cm: low, normal, cine | 10.2, 6.3, 2.5 % |"));
  EXPECT_THAT(page(), HasSubstr("in a pixel: low, normal, cine | 1.8, 2.9, 7.2 |"));
  EXPECT_THAT(page(), HasSubstr("at its middle, 20 cm | 18 %"));
  struct Row {
    DoseLevel dose;
    double mottle, to_noise;
  };
  for (const Row& row : {Row{DoseLevel::low, 0.102, 1.8}, Row{DoseLevel::normal, 0.063, 2.9},
                         Row{DoseLevel::cine, 0.025, 7.2}}) {
    const Property property = measured(row.dose, 20);
    // 20,000 pixels, whose noise is correlated a little: 1 %; and rounding.
    EXPECT_NEAR(property.mottle / row.mottle, 1, 0.03);
    EXPECT_NEAR(property.contrast / property.mottle / row.to_noise, 1, 0.04);
    // 512 pixels of that mottle: 0.5 % at the low dose.
    EXPECT_NEAR(property.contrast, 0.18, 0.01);
  }
}

}  // namespace
}  // namespace xraycast::fluoroscopy_page_test
