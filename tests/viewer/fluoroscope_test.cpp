#include "xraycast/fluoroscope/fluoroscope.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/display/display_chain.hpp"
#include "xraycast/fluoroscope/beam.hpp"
#include "xraycast/fluoroscope/counter_noise.hpp"
#include "xraycast/fluoroscope/exposure_control.hpp"
#include "xraycast/fluoroscope/scatter.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <cstdlib>
#include <numbers>
#include <numeric>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

namespace xraycast::fluoroscope_test {
namespace {

using ::testing::Each;
using ::testing::HasSubstr;

constexpr int kSide = 256;
constexpr double kPi = std::numbers::pi;

View square_view(double pixel_mm = 0.308, int side = kSide) {
  return {.cone = Cone{785, 1200}, .width = side, .height = side, .pixel_mm = pixel_mm};
}

/// An opacity whose optical depths are the water's path: 0.1 for each cm.
WaterPath ten_per_metre() { return WaterPath(Opacity("water", {{-1000, 0}, {0, 0.01}})); }

FluoroscopyOptions options_with(const std::string& stages) {
  FluoroscopyOptions options;
  options.c_arm = CArm::named("fixed-single-plane");
  options.stages = FluoroscopyStages::from_list(stages);
  return options;
}

std::vector<float> slab(double water_cm, int side = kSide) {
  return std::vector<float>(static_cast<std::size_t>(side) * side, static_cast<float>(0.1 * water_cm));
}

struct MeanAndVariance {
  double mean = 0, variance = 0;
};

MeanAndVariance statistics_of(const std::vector<float>& values) {
  MeanAndVariance found;
  for (const float value : values) found.mean += value;
  found.mean /= static_cast<double>(values.size());
  for (const float value : values) found.variance += (value - found.mean) * (value - found.mean);
  found.variance /= static_cast<double>(std::ssize(values) - 1);
  return found;
}

// ---- quanta -----------------------------------------------------------------------------------------

TEST(Fluoroscope, QuantaHaveTheSignalToNoiseRatioOfTheDetectedSpectrum) {
  for (const double water_cm : {0.0, 10.0, 20.0, 30.0})
    for (const double quanta : {5.0, 10.0, 100.0, 1000.0, 10000.0, 50000.0}) {
      FluoroscopyOptions options = options_with("quanta");
      options.kvp = 80;
      const DetectedSpectrum spectrum(open_beam(options.c_arm, 80), options.c_arm.detector);
      const EnergyMoments open = spectrum.behind_water(0), behind = spectrum.behind_water(water_cm);
      options.photons = quanta * open.m0 / behind.m0;
      if (*options.photons > 1e7) continue;
      Fluoroscope fluoroscope(options, square_view(), ten_per_metre());
      const auto [mean, variance] = statistics_of(fluoroscope.expose(slab(water_cm)).signal_kev);
      const double expected = quanta * behind.m1 * behind.m1 / (behind.m0 * behind.m2);
      // 65,536 values give a variance to 0.6 %; the bar is 5 %.
      EXPECT_NEAR(mean * mean / variance / expected, 1, 0.025) << quanta << " quanta, " << water_cm << " cm";
      EXPECT_NEAR(mean, quanta * behind.mean_kev(), 0.02 * mean);
    }
}

TEST(Fluoroscope, CountsOfOneEnergyArePoissons) {
  for (const double quanta : {0.05, 0.5, 3.0, 3.99, 5.0, 10.0, 40.0}) {
    FluoroscopyOptions options = options_with("quanta");
    options.spectrum = Spectrum("60 keV", {{60, 1}});
    options.photons = quanta;
    Fluoroscope fluoroscope(options, square_view(), ten_per_metre());
    std::vector<int> seen(200, 0);
    constexpr int kFrames = 8;
    for (int frame = 0; frame < kFrames; ++frame)
      for (const float kev : fluoroscope.expose(slab(0)).signal_kev) {
        const float count = kev / 60;
        ASSERT_NEAR(count, std::round(count), 1e-3);
        ++seen[static_cast<std::size_t>(std::lround(count))];
      }
    const double all = 1.0 * kFrames * kSide * kSide;
    double chi_squared = 0;
    int classes = 0;
    for (std::size_t k = 0; k < seen.size(); ++k) {
      const auto count = static_cast<double>(k);
      const double expected = all * std::exp(count * std::log(quanta) - quanta - std::lgamma(count + 1));
      if (expected < 20) continue;
      chi_squared += (seen[k] - expected) * (seen[k] - expected) / expected;
      ++classes;
    }
    // Chi-squared has the mean n - 1 and the variance 2 (n - 1): four standard deviations.
    EXPECT_LT(chi_squared, classes + 4 * std::sqrt(2.0 * classes)) << quanta;
  }
}

TEST(Fluoroscope, NoiseOfNeighboursAndOfFramesIsIndependent) {
  FluoroscopyOptions options = options_with("quanta");
  options.photons = 1000;
  Fluoroscope fluoroscope(options, square_view(), ten_per_metre());
  const std::vector<float> first = fluoroscope.expose(slab(0)).signal_kev;
  const std::vector<float> second = fluoroscope.expose(slab(0)).signal_kev;
  const auto [mean, variance] = statistics_of(first);
  const auto correlation = [&, m = mean, v = variance](const std::vector<float>& other, std::size_t offset) {
    double sum = 0;
    for (std::size_t i = 0; i + offset < first.size(); ++i) sum += (first[i] - m) * (other[i + offset] - m);
    return sum / v / static_cast<double>(first.size());
  };
  // Correlations of 65,536 values scatter by 0.004: four times that.
  for (const std::size_t offset : {1, 2, 16, 255, 256, 257})
    EXPECT_NEAR(correlation(first, offset), 0, 0.016) << offset;
  for (const std::size_t offset : {0, 1, 256}) EXPECT_NEAR(correlation(second, offset), 0, 0.016) << offset;
}

TEST(Fluoroscope, PicturesAreThoseOfTheirSeedWhateverTheThreads) {
  FluoroscopyOptions options = options_with("quanta,blur,lag,electronics,scatter,display");
  const auto second_frame = [&](std::uint32_t seed, std::size_t threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    options.seed = seed;
    return tbb::task_arena(static_cast<int>(threads)).execute([&] {
      Fluoroscope fluoroscope(options, square_view(), ten_per_metre());
      fluoroscope.expose(slab(15));
      return FluoroscopyFrame(fluoroscope.expose(slab(15)));
    });
  };
  const FluoroscopyFrame one = second_frame(7, 1), same = second_frame(7, 5), other = second_frame(8, 2);
  EXPECT_EQ(one.signal_kev, same.signal_kev);
  EXPECT_EQ(one.codes, same.codes);
  EXPECT_EQ(one.shown, same.shown);
  EXPECT_NE(one.signal_kev, other.signal_kev);
  const auto [mean, variance] = statistics_of(one.signal_kev);
  const auto [other_mean, other_variance] = statistics_of(other.signal_kev);
  EXPECT_NEAR(other_mean / mean, 1, 0.01);
  EXPECT_NEAR(other_variance / variance, 1, 0.03);  // blur leaves a tenth of the values independent
}

// ---- blur -------------------------------------------------------------------------------------------

/// The MTF of a slanted edge (IEC 62220-1) at `cycles` a pixel: the edge's spread by the distance from it, in
/// bins of a tenth of a pixel, differentiated and transformed.
class SlantedEdge {
 public:
  SlantedEdge(const std::vector<float>& picture, int side, double edge_pixels, double turn_rad) {
    constexpr int kReach = 30;
    std::vector<double> sums(2 * kReach * kPerPixel, 0), counts = sums;
    for (int j = 0; j < side; ++j)
      for (int i = side / 2; i < side; ++i) {
        const double x = i + 0.5 - 0.5 * side, y = 0.5 * side - j - 0.5;
        const double inside = edge_pixels - (std::cos(turn_rad) * x + std::sin(turn_rad) * y);
        const auto bin = static_cast<std::ptrdiff_t>(std::floor((inside + kReach) * kPerPixel));
        if (bin < 0 || bin >= std::ssize(sums) || std::abs(y) > 0.3 * side) continue;
        sums[static_cast<std::size_t>(bin)] += picture[static_cast<std::size_t>(j) * side + i];
        ++counts[static_cast<std::size_t>(bin)];
      }
    for (std::size_t bin = 0; bin < sums.size(); ++bin)
      spread_.push_back(sums[bin] / std::max(1.0, counts[bin]));
  }
  double mtf(double cycles) const {
    std::complex<double> sum = 0;
    double whole = 0;
    for (std::size_t bin = 1; bin < spread_.size(); ++bin) {
      const double line = spread_[bin] - spread_[bin - 1];
      sum += line * std::polar(1.0, -2 * kPi * cycles * static_cast<double>(bin) / kPerPixel);
      whole += line;
    }
    const double turn = kPi * cycles / kPerPixel, bins = turn > 0 ? std::sin(turn) / turn : 1;
    return std::abs(sum) / whole / (bins * bins);  // of the bin, and of the difference
  }

 private:
  static constexpr int kPerPixel = 10;
  std::vector<double> spread_;
};

TEST(Fluoroscope, ASlantedBladeHasTheAskedMtf) {
  for (const char* name : {"fixed-single-plane", "mobile-intensifier"})
    for (const double pixel_mm : {0.154, 0.23, 0.308}) {
      FluoroscopyOptions options = options_with("blur");
      options.c_arm = CArm::named(name);
      options.photons = 1000;
      constexpr double kTurn_rad = 2 * kPi / 180, kEdge_pixels = 60;
      options.collimation = Collimation{2 * kEdge_pixels * pixel_mm, 1e4, kTurn_rad};
      View view = square_view(pixel_mm);
      view.cone = options.c_arm.distances;
      Fluoroscope fluoroscope(options, view, ten_per_metre());
      const SlantedEdge edge(fluoroscope.expose(slab(0)).signal_kev, kSide, kEdge_pixels, kTurn_rad);
      const CArm& c_arm = options.c_arm;
      const double focal_mm = c_arm.tube.focal_spot_mm / 2.3548 *
                              (c_arm.distances.source_detector_mm / c_arm.distances.source_axis_mm - 1);
      for (double cycles = 0.02; cycles <= 0.5; cycles += 0.02) {
        const double asked = c_arm.detector.blur.mtf(cycles / pixel_mm) * std::sin(kPi * cycles) /
                             (kPi * cycles) * std::exp(-2 * std::pow(kPi * focal_mm / pixel_mm * cycles, 2));
        EXPECT_NEAR(edge.mtf(cycles), asked, 0.02)
            << name << ", " << pixel_mm << " mm, " << cycles;  // the bar
      }
    }
}

/// The noise power spectrum of a square picture along x, without the mean, of a few low frequencies along y.
/// A Hann window keeps the power of low frequencies out of high ones, which have a hundredth of it.
void add_power(const std::vector<float>& picture, std::vector<double>& power) {
  const double mean = statistics_of(picture).mean;
  constexpr int kRows = 12;
  for (int ky = 1; ky <= kRows; ++ky) {
    std::vector<std::complex<double>> row(kSide);
    for (int j = 0; j < kSide; ++j) {
      const auto wave = std::polar(1.0, -2 * kPi * ky * j / kSide);
      for (int i = 0; i < kSide; ++i)
        row[i] += wave * (picture[static_cast<std::size_t>(j) * kSide + i] - mean);
    }
    constexpr double kWindowPower = 3.0 / 8;
    for (int i = 0; i < kSide; ++i)
      row[i] *= 0.5 * (1 - std::cos(2 * kPi * (i + 0.5) / kSide)) / std::sqrt(kWindowPower);
    for (int kx = 1; kx <= kSide / 2; ++kx) {
      std::complex<double> sum = 0;
      const auto step = std::polar(1.0, -2 * kPi * kx / kSide);
      std::complex<double> wave = 1;
      for (int i = 0; i < kSide; ++i, wave *= step) sum += wave * row[i];
      power[kx] += std::norm(sum) / kRows / (1.0 * kSide * kSide);
    }
  }
}

/// Noise as it comes about: quanta are absorbed anywhere in a pixel, the light of each spreads from there,
/// and pixels collect what falls on them. The mean power of their responses over all places of an 8 x 8 grid.
class PowerOfScatteredLight {
 public:
  PowerOfScatteredLight(const ScintillatorBlur& blur, double pixel_mm)
      : narrow_(blur.narrow_mm / pixel_mm), wide_(blur.wide_mm / pixel_mm), share_(blur.wide_share) {}

  double at(double across, double down) const {
    double sum = 0;
    for (int x = 0; x < kPlaces; ++x)
      for (int y = 0; y < kPlaces; ++y)
        sum += std::norm((1 - share_) * collected(narrow_, x, across) * collected(narrow_, y, down) +
                         share_ * collected(wide_, x, across) * collected(wide_, y, down));
    return sum / (kPlaces * kPlaces);
  }

 private:
  static constexpr int kPlaces = 8;

  static std::complex<double> collected(double spread, int place, double cycles) {
    const double from = (place + 0.5) / kPlaces - 0.5;
    const auto below = [&](double at) { return 0.5 * std::erfc((from - at) / spread / std::numbers::sqrt2); };
    const int reach = static_cast<int>(std::ceil(1 + 6 * spread));
    std::complex<double> sum = 0;
    for (int pixel = -reach; pixel <= reach; ++pixel)
      sum += (below(pixel + 0.5) - below(pixel - 0.5)) * std::polar(1.0, -2 * kPi * cycles * pixel);
    return sum;
  }

  double narrow_, wide_, share_;
};

struct NoisePower {
  double measured = 0, predicted = 0;
};

/// Of 100 quanta a pixel, in bands of frequencies along x up to Nyquist's, next to none along y; only where
/// the light leaves more than `least` of the power.
std::vector<NoisePower> noise_powers(const char* c_arm, double pixel_mm, const char* stages, double least) {
  constexpr double kQuanta = 100;
  FluoroscopyOptions options = options_with(stages);
  options.c_arm = CArm::named(c_arm);
  options.kvp = 80;
  options.photons = kQuanta;
  Fluoroscope fluoroscope(options, square_view(pixel_mm), ten_per_metre());
  std::vector<double> power(kSide / 2 + 1, 0);
  constexpr int kFrames = 48;
  for (int frame = 0; frame < kFrames; ++frame) add_power(fluoroscope.expose(slab(0)).signal_kev, power);
  const FluoroscopyDetector& detector = options.c_arm.detector;
  const EnergyMoments open = DetectedSpectrum(open_beam(options.c_arm, 80), detector).behind_water(0);
  const double electronic_kev =
      options.stages.electronics ? detector.electronic_noise_kev * pixel_mm / detector.pixel_mm : 0;
  constexpr int kBand = 8;
  constexpr double kMiddleRow = 6.5;
  const PowerOfScatteredLight light(detector.blur, pixel_mm);
  std::vector<NoisePower> bands;
  for (int first = 1; first + kBand <= kSide / 2 + 1; first += kBand) {
    NoisePower band;
    for (int kx = first; kx < first + kBand; ++kx) {
      const double share = light.at(1.0 * kx / kSide, kMiddleRow / kSide);
      if (share < least) return bands;
      band.measured += power[kx] / kFrames;
      band.predicted += kQuanta * open.m2 / open.m0 * share + electronic_kev * electronic_kev;
    }
    bands.push_back(band);
  }
  return bands;
}

TEST(Fluoroscope, NoisePowerIsWhatLightOfQuantaAnywhereAndElectronicsPredict) {
  for (const char* c_arm : {"fixed-single-plane", "mobile-intensifier"})
    for (const double pixel_mm : {0.154, 0.23, 0.308}) {
      const auto bands = noise_powers(c_arm, pixel_mm, "quanta,blur,electronics", 0);
      ASSERT_EQ(bands.size(), 16u);
      // The bar; 4,608 values scatter by 1.5 %.
      for (const NoisePower& band : bands)
        EXPECT_NEAR(band.measured / band.predicted, 1, 0.05) << c_arm << ", " << pixel_mm << " mm";
    }
}

TEST(Fluoroscope, NoisePowerOfQuantaFollowsTheLightWhereItIsWeak) {
  for (const char* c_arm : {"fixed-single-plane", "mobile-intensifier"})
    for (const double pixel_mm : {0.154, 0.23, 0.308}) {
      const auto bands = noise_powers(c_arm, pixel_mm, "quanta,blur", 0.0025);
      ASSERT_GE(bands.size(), 8u);
      for (const NoisePower& band : bands)
        EXPECT_NEAR(band.measured / band.predicted, 1, 0.05) << c_arm << ", " << pixel_mm << " mm";
    }
}

TEST(Fluoroscope, ThePowerOfScatteredLightIsThatOfCascadedTheory) {
  // Without blur quanta of neighbours stay apart; with it, the transfer of light and aperture squared, at all
  // frequencies that a grid takes for one.
  const ScintillatorBlur blur = CArm::named("fixed-single-plane").detector.blur;
  const PowerOfScatteredLight light(blur, 0.308);
  for (const double cycles : {0.0, 0.2, 0.4}) {
    double sum = 0;
    for (int k = -8; k <= 8; ++k)
      for (int l = -8; l <= 8; ++l) {
        const auto aperture = [](double at) { return at == 0 ? 1 : std::sin(kPi * at) / (kPi * at); };
        sum += std::pow(
            blur.mtf(std::hypot(cycles + k, 0.1 + l) / 0.308) * aperture(cycles + k) * aperture(0.1 + l), 2);
      }
    EXPECT_NEAR(light.at(cycles, 0.1) / sum, 1, 0.01) << cycles;  // of 8 x 8 places
  }
}

// ---- lag --------------------------------------------------------------------------------------------

TEST(Fluoroscope, LagHasItsStepResponse) {
  FluoroscopyOptions options = options_with("lag");
  options.photons = 1000;
  Fluoroscope fluoroscope(options, square_view(0.3, 32), ten_per_metre());
  FluoroscopyOptions without = options;
  without.stages.lag = false;
  const double whole =
      Fluoroscope(without, square_view(0.3, 32), ten_per_metre()).expose(slab(0, 32)).signal_kev[0];
  constexpr int kOn = 20, kOff = 10;
  constexpr double kRounding = 1e-5;
  for (int pulse = 0; pulse < kOn; ++pulse) {
    double expected = 1;
    for (const LagTrap& trap : options.c_arm.detector.lag)
      expected -= trap.fraction * std::exp(-pulse / (options.pulses_per_s * trap.time_s));
    EXPECT_NEAR(fluoroscope.expose(slab(0, 32)).signal_kev[0] / whole, expected, kRounding) << pulse;
  }
  for (int pulse = 0; pulse < kOff; ++pulse) {
    double expected = 0;
    for (const LagTrap& trap : options.c_arm.detector.lag) {
      const double stays = std::exp(-1 / (options.pulses_per_s * trap.time_s));
      expected += trap.fraction * (1 - std::pow(stays, kOn)) * std::pow(stays, pulse);
    }
    EXPECT_NEAR(fluoroscope.expose(slab(1e6, 32)).signal_kev[0] / whole, expected, kRounding) << pulse;
  }
}

// ---- exposure and dose --------------------------------------------------------------------------------

TEST(Fluoroscope, AirKermaAndDoseAreaProductAreThoseOfNarrowBeams) {
  for (const double water_cm : {10.0, 20.0, 30.0}) {
    FluoroscopyOptions options = options_with("none");
    options.kvp = 80;
    const CArm& c_arm = options.c_arm;
    Fluoroscope fluoroscope(options, square_view(), ten_per_metre());
    fluoroscope.settle(slab(water_cm));
    const FluoroscopyFrame& frame = fluoroscope.expose(slab(water_cm));
    // Backwards from the energy in the detector: a pixel, the slab, the table, the grid, the distances.
    double absorbed_kev = 0, kerma_uGy = 0;
    const Spectrum tube = tube_spectrum(80, {c_arm.tube.aluminium_mm, c_arm.tube.copper_mm});
    for (const auto& [kev, photons] : tube.bins()) {
      const double table = 0.1 * c_arm.table_mm * 2.699 * mass_attenuation_cm2_g("Al", kev);
      const double passed = std::exp(-table - water_cm * mass_attenuation_cm2_g("Water, Liquid", kev));
      absorbed_kev += passed * photons *
                      DetectedSpectrum(Spectrum("line", {{kev, 1}}), c_arm.detector).behind_water(0).m1;
      // Air's mass energy-absorption coefficient by NIST from 20 to 80 keV, as a power law between: cm2/g.
      constexpr double kNist[][2] = {{10, 4.742},   {15, 1.334},   {20, 0.5389},
                                     {30, 0.1537},  {40, 0.06833}, {50, 0.04098},
                                     {60, 0.03041}, {80, 0.02407}, {100, 0.02325}};
      std::size_t k = 1;
      while (kNist[k][0] < kev) ++k;
      const double part = std::log(kev / kNist[k - 1][0]) / std::log(kNist[k][0] / kNist[k - 1][0]);
      const double air = kNist[k - 1][1] * std::pow(kNist[k][1] / kNist[k - 1][1], part);
      kerma_uGy += 1.602e-7 * photons * kev * air;
    }
    const double pixel_cm2 = 0.0308 * 0.0308;
    const double to_detector = std::pow(1000.0 / 1200, 2) * c_arm.grid->primary;
    const double mas = frame.mean_kev / (absorbed_kev * to_detector * pixel_cm2);
    const double reference_mm = 785 - 150;
    const double kerma_mGy = 1e-3 * mas * kerma_uGy * std::pow(1000 / reference_mm, 2);
    const double area_cm2 = std::pow(kSide * 0.0308 * reference_mm / 1200, 2);
    // The bar; NIST's tables and xraylib's differ by 1 %.
    EXPECT_NEAR(fluoroscope.dose().air_kerma_mGy / kerma_mGy, 1, 0.05) << water_cm;
    EXPECT_NEAR(fluoroscope.dose().dap_Gycm2 / (1e-3 * kerma_mGy * area_cm2), 1, 0.05) << water_cm;
    const bool suffices = water_cm < 30;  // beyond, the power at 80 kV does not
    EXPECT_TRUE(!suffices || std::abs(frame.mean_kev / fluoroscope.target_kev() - 1) < 0.05) << water_cm;
    EXPECT_EQ(fluoroscope.dose().pulses, 1);
    EXPECT_NEAR(fluoroscope.dose().fluoroscopy_s, 1.0 / 15, 1e-12);
  }
}

TEST(Fluoroscope, TheTubesOutputIsThatOfRealTubes) {
  // Around 60 and 90 uGy/mAs at 1 m behind 2.5 mm of aluminium; tubes differ by 15 %.
  const XrayTube bare{};
  EXPECT_NEAR(air_kerma_uGy_per_mas(bare, 80, 1000), 60, 9);
  EXPECT_NEAR(air_kerma_uGy_per_mas(bare, 100, 1000), 90, 5);
}

TEST(Fluoroscope, ExposureControlSettlesWithinFivePulsesFromAnyStart) {
  for (const DoseLevel dose : {DoseLevel::low, DoseLevel::normal, DoseLevel::cine})
    for (const double before_cm : {0.0, 5.0, 18.0, 35.0})
      for (const double after_cm : {8.0, 15.0, 22.0}) {
        FluoroscopyOptions options = options_with("quanta,blur,lag,electronics,scatter,display");
        options.dose = dose;
        Fluoroscope fluoroscope(options, square_view(0.308, 64), ten_per_metre());
        constexpr int kBefore = 10, kPulses = 5;
        for (int pulse = 0; pulse < kBefore; ++pulse) fluoroscope.expose(slab(before_cm, 64));
        for (int pulse = 0; pulse < kPulses; ++pulse) fluoroscope.expose(slab(after_cm, 64));
        const double mean_kev = fluoroscope.expose(slab(after_cm, 64)).mean_kev;
        // What is steady: 3 %, and what a pulse's noise adds to the mean.
        EXPECT_NEAR(mean_kev / fluoroscope.target_kev(), 1, 0.05) << before_cm << " to " << after_cm << " cm";
      }
}

TEST(Fluoroscope, ExposureControlKeepsTheLimitOfTheAirKermaRate) {
  FluoroscopyOptions options = options_with("none");
  Fluoroscope fluoroscope(options, square_view(0.308, 64), ten_per_metre());
  fluoroscope.settle(slab(60, 64));
  const Technique technique = fluoroscope.technique();
  const double rate_mGy_min =
      1e-3 * 60 * 15 * technique.mas * air_kerma_uGy_per_mas(options.c_arm.tube, technique.kvp, 1200 - 300);
  EXPECT_LE(rate_mGy_min, 88.001);  // 21 CFR 1020.32
  EXPECT_LE(technique.mas, 1.001 * highest_mas(options.c_arm.tube, technique.kvp));
  EXPECT_EQ(technique.kvp, 125);
}

// ---- scatter ------------------------------------------------------------------------------------------

TEST(Scatter, GrowsWithThicknessAndField) {
  constexpr int kCells = 60;
  constexpr double kCell_mm = 5;
  Scatter scatter(kCells, kCells, kCell_mm, {0, 0});
  const auto ratio = [&](double field_mm, float g_cm2) {
    std::vector<float> primary(kCells * kCells, 0), water(kCells * kCells, g_cm2);
    for (int j = 0; j < kCells; ++j)
      for (int i = 0; i < kCells; ++i)
        if (std::max(std::abs(i + 0.5 - kCells / 2), std::abs(j + 0.5 - kCells / 2)) * 2 * kCell_mm <
            field_mm)
          primary[j * kCells + i] = 0.01f;
    return scatter.from(primary, water)[(kCells / 2) * kCells + kCells / 2] / 0.01;
  };
  EXPECT_NEAR(ratio(300, 20), 3, 0.06);  // the closed form of the Gaussian's part in the field
  EXPECT_NEAR(ratio(300, 10), 1.5, 0.03);
  // Altunbas, 2016: 4.51 behind 30 cm of acrylic, of 1.18 g/cm3, with an air gap that is longer than a
  // C-arm's.
  EXPECT_GT(ratio(300, 30 * 1.18f), 4.51);
  EXPECT_LT(ratio(300, 30 * 1.18f), 1.3 * 4.51);
  const double side = std::erf(50 / 60.0 / std::numbers::sqrt2);
  EXPECT_NEAR(ratio(100, 20), 0.154 * 20 * side * side, 0.06);
}

TEST(Fluoroscope, AGridHoldsScatterBack) {
  const auto added = [](bool has_grid) {
    FluoroscopyOptions options = options_with("scatter");
    if (!has_grid) options.c_arm.grid.reset();
    options.photons = 1000;
    const double with = Fluoroscope(options, square_view(1.1), ten_per_metre()).expose(slab(20)).mean_kev;
    options.stages.scatter = false;
    return with / Fluoroscope(options, square_view(1.1), ten_per_metre()).expose(slab(20)).mean_kev - 1;
  };
  const double open = added(false);
  EXPECT_NEAR(open, 2.9, 0.3);  // 28 x 28 cm behind 20 cm of water, the mean of the measuring field
  EXPECT_NEAR(added(true) / open, 0.11 / 0.74, 0.01);
}

// ---- display ------------------------------------------------------------------------------------------

TEST(DisplayChain, TheTemporalFilterReducesNoise) {
  constexpr int kWidth = 64, kFrames = 60;
  const PictureSize size{kWidth, kWidth};
  DisplayChain display(size, 0.2, 0);
  const PixelPlane field(size.pixels(), 1);
  std::vector<float> noise(kWidth * kWidth), shown;
  std::vector<std::uint8_t> grey(kWidth * kWidth);
  for (int frame = 0; frame < kFrames; ++frame) {
    for (int i = 0; i < kWidth * kWidth; ++i)
      noise[i] =
          0.1f *
          normals_of(random_pair(static_cast<std::uint32_t>(i), static_cast<std::uint32_t>(frame), 5)).first;
    display.show({noise, field, field}, {.measured = 0, .open = 2}, false, true, grey.data());
  }
  shown.assign(grey.begin(), grey.end());
  // Edge enhancement by s of the mean of nine pixels less that of n: 1 + (2 s + s^2) (1/9 - 1/n), and less
  // where it is cut off: there are 0.033 of standard deviation for 0.1. The filter's weight of 0.4 leaves
  // 0.4 / 1.6; greys are 255 / 2.4 a unit of the logarithm.
  const double s = EdgeEnhancement::kStrength, side = 2 * EdgeEnhancement(size, 0.2).reach() + 1;
  const double edge = 1 + (2 * s + s * s) * (1.0 / 9 - 1 / (side * side));
  const double expected = std::pow(0.1 * 255 / 2.4, 2) * edge * 0.4 / 1.6;
  // 4,096 values: 2 %, and rounding; what is taken for lines that move by chance takes another tenth.
  EXPECT_NEAR(statistics_of(shown).variance / expected, 1.1, 0.09);
}

TEST(Fluoroscope, TheMeasuringFieldIsShownInMediumGrey) {
  for (const double water_cm : {5.0, 15.0, 25.0}) {
    FluoroscopyOptions options = options_with("none");
    Fluoroscope fluoroscope(options, square_view(0.308, 64), ten_per_metre());
    fluoroscope.settle(slab(water_cm, 64));
    EXPECT_THAT(fluoroscope.expose(slab(water_cm, 64)).shown,
                Each(testing::AllOf(testing::Ge(126), testing::Le(129))));
  }
}

TEST(Fluoroscope, AirBesideABodyDoesNotTakeItsExposure) {
  constexpr int kPixels = 128;
  for (const double water_cm : {8.0, 16.0, 24.0}) {
    const auto technique = [&](double body) {  // as wide as a share of the picture
      std::vector<float> tau = slab(0, kPixels);
      const std::vector<float> inside = slab(water_cm, kPixels);
      for (int i = 0; i < kPixels * kPixels; ++i)
        if (std::abs(2 * (i % kPixels) + 1 - kPixels) < body * kPixels)
          tau[static_cast<std::size_t>(i)] = inside[0];
      Fluoroscope fluoroscope(options_with("quanta"), square_view(1, kPixels), ten_per_metre());
      fluoroscope.settle(tau);
      return fluoroscope.expose(tau).technique;
    };
    const Technique whole = technique(1), narrow = technique(0.2), none = technique(0);
    EXPECT_NEAR(narrow.kvp, whole.kvp, 1) << water_cm;
    EXPECT_NEAR(narrow.mas, whole.mas, 0.05 * whole.mas) << water_cm;
    EXPECT_LT(none.kvp * none.mas, whole.kvp * whole.mas)
        << "what is open counts where nothing else is there";
  }
}

TEST(Fluoroscope, APictureLargerThanTheDetectorDoesNotChangeExposureAndDose) {
  // A body whose thin sides lie beyond the detector, as a trunk from the side in a large picture.
  const auto seen = [&](double picture_mm) {
    constexpr int kPixels = 128;
    const double pixel_mm = picture_mm / kPixels;
    const float thick = slab(22, 1)[0], thin = slab(3, 1)[0];
    std::vector<float> tau(std::size_t{kPixels} * kPixels);
    for (int i = 0; i < kPixels * kPixels; ++i)
      tau[static_cast<std::size_t>(i)] =
          std::abs(i % kPixels + 0.5 - 0.5 * kPixels) * pixel_mm < 100 ? thick : thin;
    Fluoroscope fluoroscope(options_with("quanta"), square_view(pixel_mm, kPixels), ten_per_metre());
    fluoroscope.settle(tau);
    const Technique technique = fluoroscope.expose(tau).technique;
    return std::pair(technique, fluoroscope.dose().dap_Gycm2 / fluoroscope.dose().air_kerma_mGy);
  };
  const FluoroscopyDetector& detector = options_with("quanta").c_arm.detector;
  const auto [whole, area] = seen(std::min(detector.width_mm, detector.height_mm));
  const auto [large, large_area] = seen(2 * std::max(detector.width_mm, detector.height_mm));
  EXPECT_NEAR(large.kvp, whole.kvp, 1);
  EXPECT_NEAR(large.mas, whole.mas, 0.05 * whole.mas) << "other pixels are measured";
  const double longest = std::max(detector.width_mm, detector.height_mm),
               shortest = std::min(detector.width_mm, detector.height_mm);
  EXPECT_NEAR(large_area / area, longest / shortest, 0.01) << "the detector, of which the first is a square";
}

// ---- C-arms and options -------------------------------------------------------------------------------

TEST(CArm, PresetsAreWholeAndFieldsSetTheView) {
  for (const std::string& name : CArm::preset_names()) {
    const CArm c_arm = CArm::named(name);
    EXPECT_EQ(c_arm.name, name);
    for (const double field_mm : c_arm.fields_mm) {
      const View view = view_of(c_arm, field_mm, {});
      EXPECT_NEAR(view.width * view.pixel_mm, std::min(field_mm, c_arm.detector.width_mm), view.pixel_mm)
          << name;
      EXPECT_LE(view.width, 1281);
    }
  }
}

TEST(CArm, SaysWhatIsWrongWithAFile) {
  const auto message = [](const std::string& text) {
    try {
      CArm::from_json(text, "my.json");
      return std::string("accepted");
    } catch (const InputError& error) {
      return std::string(error.what());
    }
  };
  EXPECT_THAT(message("[1]"), HasSubstr("my.json: not a JSON object"));
  EXPECT_THAT(message("{}"), HasSubstr("my.json: \"source_axis_mm\" is missing"));
  EXPECT_THAT(message(R"({"source_axis_mm": 800, "source_detector_mm": 700})"),
              HasSubstr("my.json: \"source_detector_mm\" is 700; it must be 800 to 5000"));
  EXPECT_THAT(message(R"({"source_axis_mm": 800, "source_detector_mm": 1200, "tube": 3})"),
              HasSubstr("my.json: tube: not a JSON object"));
  const std::string preset = read_whole_file(XRAYCAST_SOURCE_DIR "/viewer/c_arms/mobile-intensifier.json");
  const auto changed = [&](const char* from, const char* to) {
    std::string text = preset;
    return text.replace(text.find(from), std::string_view(from).size(), to);
  };
  EXPECT_THAT(message(changed("\"grid\": {", "\"grids\": {")),
              HasSubstr("my.json: \"grids\" is no key of it"));
  EXPECT_THAT(message(changed("\"wide_mm\":", "\"wide\":")),
              HasSubstr("my.json: detector: blur: \"wide\" is no key of it"));
  EXPECT_THAT(message(changed("\"bits\": 12", "\"bits\": 12.9")), HasSubstr("must be a whole number"));
  EXPECT_THAT(message(changed("\"lowest_kvp\": 40", "\"lowest_kvp\": 40.5")),
              HasSubstr("my.json: tube: \"lowest_kvp\" is 40.5; it must be a whole number"));
  const auto with_display = [&](const char* display) {
    return preset.substr(0, preset.rfind('}')) + ", \"display\": " + display + "}";
  };
  EXPECT_EQ(CArm::from_json(with_display(R"({"compression": 0.6})"), "my.json").compression, 0.6);
  EXPECT_THAT(message(with_display(R"({"compression": 2})")),
              HasSubstr("my.json: display: \"compression\" is 2; it must be 0 to 1"));
  const auto with_lag = [&](const char* lag) {
    std::string text = preset;
    const auto from = text.find("[{\"fraction\""), end = text.find(']', from) + 1;
    return text.replace(from, end - from, lag);
  };
  EXPECT_THAT(message(with_lag("[{}]")), HasSubstr("my.json: detector: lag: \"fraction\" is missing"));
  EXPECT_THAT(message(with_lag(R"([{"fraction": 0.4, "time_s": 1}, {"fraction": 0.3, "time_s": 1}])")),
              HasSubstr("my.json: detector: the fractions of lag add up to 0.7; they must stay below 0.5"));
}

TEST(Fluoroscope, SaysWhatIsWrongWithItsOptions) {
  const auto message = [](const auto& change) {
    FluoroscopyOptions options = options_with("none");
    change(options);
    try {
      check(options);
      return std::string("accepted");
    } catch (const InputError& error) {
      return std::string(error.what());
    }
  };
  using O = FluoroscopyOptions;
  EXPECT_EQ(message([](O&) {}), "accepted");
  EXPECT_THAT(message([](O& o) { o.photons = 0; }), HasSubstr("0 photons per pixel: must be above 0"));
  EXPECT_THAT(message([](O& o) { o.mas = INFINITY; }), HasSubstr("inf mAs: must be above 0 and at most"));
  EXPECT_THAT(message([](O& o) { o.kvp = 160; }), HasSubstr("allows 50 to 125 kVp"));
  EXPECT_THAT(message([](O& o) { o.pulses_per_s = 0; }), HasSubstr("0 pulses/s: must be 3 to 30"));
  EXPECT_THAT(message([](O& o) { o.collimation = Collimation{0, 10}; }), HasSubstr("collimator is shut"));
  EXPECT_THAT(message([](O& o) {
                o.spectrum = Spectrum("a.txt", {{60, 1}});
              }),
              HasSubstr("give the photons"));
  EXPECT_THROW(FluoroscopyStages::from_list("quanta,foo"), InputError);
  EXPECT_THROW(FluoroscopyStages::from_list(""), InputError);
}

}  // namespace
}  // namespace xraycast::fluoroscope_test
