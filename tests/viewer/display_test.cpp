#include "xraycast/display/display_window.hpp"
#include "xraycast/display/dynamic_range.hpp"
#include "xraycast/display/starved_pixels.hpp"
#include "xraycast/display/temporal_filter.hpp"
#include "xraycast/fluoroscope/fluoroscope.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

namespace xraycast::display_test {
namespace {

constexpr PictureSize kSize{480, 400};
constexpr float kStrength = 0.6f;

/// A picture by a function of column and row.
template <typename Value>
PixelPlane plane_of(const Value& value) {
  PixelPlane plane;
  for (int j = 0; j < kSize.height; ++j)
    for (int i = 0; i < kSize.width; ++i) plane.push_back(static_cast<float>(value(i, j)));
  return plane;
}

PixelPlane compressed(const PixelPlane& logarithm, double pixel_mm, float strength = kStrength) {
  DynamicRange range(kSize, pixel_mm);
  range.measure(logarithm);
  PixelPlane out(logarithm.size());
  for (int j = 0; j < kSize.height; ++j)
    range.compress_row(j, logarithm.data() + kSize.row(j), strength, 5, out.data() + kSize.row(j));
  return out;
}

double ramp(double x, double softness) { return 1 / (1 + std::exp(-x / softness)); }

double spread_of(const std::vector<double>& values) {
  double sum = 0, squares = 0;
  for (const double value : values) {
    sum += value;
    squares += value * value;
  }
  const auto count = static_cast<double>(values.size());
  return std::sqrt(squares / count - sum * sum / count / count);
}

/// The logarithms of random steps, as at a lung's edge and at metal.
TEST(DynamicRange, EdgesDoNotRing) {
  constexpr std::uint32_t kSeeds = 200;
  std::uint32_t few = 0;
  for (std::uint32_t seed = 0; seed < kSeeds; ++seed) {
    std::mt19937 random(seed);
    const auto uniform = [&](double low, double high) {
      return std::uniform_real_distribution(low, high)(random);
    };
    const double height = uniform(0.3, 3), softness = uniform(0.7, 6), angle = uniform(0, 6.28),
                 offset = uniform(-20, 20), pixel_mm = uniform(0.2, 0.7);
    const auto along = [&](int i, int j) {
      return (i - 240) * std::cos(angle) + (j - 200) * std::sin(angle) - offset;
    };
    const PixelPlane shown = compressed(
        plane_of([&](int i, int j) { return 5 + height * ramp(along(i, j), softness); }), pixel_mm);
    // Far from the edge, and all.
    float low = 0, high = 0, least = HUGE_VALF, most = -HUGE_VALF;
    for (int j = 0; j < kSize.height; ++j)
      for (int i = 0; i < kSize.width; ++i) {
        const float value = shown[kSize.row(j) + static_cast<std::size_t>(i)];
        if (along(i, j) < -120) low = value;
        if (along(i, j) > 120) high = value;
        least = std::min(least, value);
        most = std::max(most, value);
      }
    const float step = high - low;
    EXPECT_NEAR(step, (1 - kStrength) * height, 0.02 * height) << seed;
    const float rings = std::max(low - least, most - high) / step;
    // Edges sharper than two pixels part cells, which are mixtures then: of these lines make the most.
    EXPECT_LT(rings, 0.18f) << seed << ": a step of " << height << ", " << softness << " pixels soft, of "
                            << pixel_mm << " mm";
    few += rings < 0.05f;
  }
  EXPECT_GE(few, 0.95 * kSeeds);
}

/// Lines on bodies that are even or slope: where the base follows the body, signal and noise are reduced
/// alike.
TEST(DynamicRange, InstrumentsKeepTheirContrastToNoise) {
  std::mt19937 random(5);
  std::normal_distribution<float> normal(0, 0.1f);
  const PixelPlane noise = plane_of([&](int, int) { return normal(random); });
  for (const double width_px : {2.0, 6.0, 10.0})  // at 0.2 mm: a wire of 0.4 mm to a catheter of 2 mm
    for (const double slope : {0.0, 2e-3}) {      // of the body beneath, an e in 10 cm
      const auto body = [&](int i, int j) { return 5 + slope * (i + 0.5 * j); };
      const auto line = [&](int i) { return std::abs(i - 239.5) <= width_px / 2 ? 0.15 : 0.0; };
      const auto noisy = [&](int i, int j) {
        return body(i, j) + noise[kSize.row(j) + static_cast<std::size_t>(i)];
      };
      const PixelPlane without = compressed(plane_of(noisy), 0.2), still = compressed(plane_of(body), 0.2),
                       with = compressed(plane_of([&](int i, int j) { return noisy(i, j) - line(i); }), 0.2);
      double contrast = 0, spread = 0, raw = 0, count = 0;
      for (int j = 100; j < 300; ++j)
        for (int i = 238; i <= 241; ++i) {
          const std::size_t at = kSize.row(j) + static_cast<std::size_t>(i);
          if (line(i) == 0) continue;
          contrast += without[at] - with[at];
          spread += std::pow(without[at] - still[at], 2);
          raw += std::pow(noise[at], 2);
          ++count;
        }
      const double gain = std::sqrt(spread / raw);
      // The tenth is what means over 2 cm have of a line of 2 mm.
      EXPECT_GT(contrast / count / 0.15, 0.9 * gain) << width_px << " pixels, slope " << slope;
    }
}

/// Lines across soft edges, as of a lung or the liver: against the pixels beside them, and these pixels'
/// noise.
TEST(DynamicRange, InstrumentsAreSeenAcrossEdges) {
  constexpr double kLine = 0.15;
  std::mt19937 random(5);
  std::normal_distribution<float> normal(0, 0.1f);
  const PixelPlane noise = plane_of([&](int, int) { return normal(random); });
  for (const double width_px : {2.0, 6.0, 10.0})
    for (const double softness : {4.0, 10.0, 25.0, 60.0}) {
      const auto still = [&](int i, int j) { return 5 + 1.5 * ramp(i + 0.3 * j - 300, softness); };
      const auto noisy = [&](int i, int j) {
        return still(i, j) + noise[kSize.row(j) + static_cast<std::size_t>(i)];
      };
      const auto is_line = [&](int i) { return std::abs(i - 239.5) <= width_px / 2; };
      const PixelPlane body = compressed(plane_of(still), 0.2), without = compressed(plane_of(noisy), 0.2),
                       with = compressed(
                           plane_of([&](int i, int j) { return noisy(i, j) - is_line(i) * kLine; }), 0.2);
      double ratios = 0, bands = 0;
      for (int first = 120; first < 280; first += 8, ++bands) {
        double in = 0, in_count = 0, beside = 0, beside_count = 0;
        std::vector<double> shown_noise, raw_noise;
        for (int j = first; j < first + 8; ++j)
          for (int i = 220; i < 260; ++i) {
            if (std::abs(i - 239.5) > 1.5 * width_px + 1) continue;
            const std::size_t at = kSize.row(j) + static_cast<std::size_t>(i);
            (is_line(i) ? in : beside) += without[at] - with[at];
            (is_line(i) ? in_count : beside_count) += 1;
            shown_noise.push_back(without[at] - body[at]);
            raw_noise.push_back(noise[at]);
          }
        ratios +=
            (in / in_count - beside / beside_count) / kLine * spread_of(raw_noise) / spread_of(shown_noise);
      }
      // As in the raw picture, but for a tenth.
      EXPECT_GT(ratios / bands, 0.9) << width_px << " pixels, an edge of " << softness;
    }
}

TEST(DynamicRange, NothingChangesWithoutStrength) {
  const PixelPlane logarithm = plane_of([](int i, int j) { return 5 + std::sin(0.1 * i) + 0.01 * j; });
  EXPECT_EQ(compressed(logarithm, 0.3, 0), logarithm);
}

/// A picture of pixels' noise, with a code of 300 for no signal.
constexpr CodeNoise kNoise{.dark = 300, .electronic = 12, .per_code = 2};

std::vector<std::uint16_t> noisy_codes(double signal, std::uint32_t seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(
      0, std::sqrt(kNoise.electronic * kNoise.electronic + kNoise.per_code * signal));
  std::vector<std::uint16_t> codes;
  for (std::size_t i = 0; i < kSize.pixels(); ++i)
    codes.push_back(
        static_cast<std::uint16_t>(std::max(0.0, std::round(kNoise.dark + signal + normal(random)))));
  return codes;
}

PixelPlane logarithms_of(const std::vector<std::uint16_t>& codes) {
  PixelPlane logarithm;
  for (const std::uint16_t code : codes)
    logarithm.push_back(std::log(std::max(1.0f, static_cast<float>(code) - kNoise.dark)));
  return logarithm;
}

TEST(StarvedPixels, AreNoBlackSpecks) {
  StarvedPixels starved(kSize);
  starved.set_noise(kNoise);
  for (const double signal : {5.0, 12.0, 25.0, 45.0}) {
    const std::vector<std::uint16_t> codes = noisy_codes(signal, 3);
    const PixelPlane raw = logarithms_of(codes), calm = starved.calmed(codes, raw);
    const auto specks = [&](const PixelPlane& shown) {
      const auto dark = std::ranges::count_if(shown, [&](float l) { return l < std::log(signal) - 1.2; });
      return static_cast<double>(dark) / static_cast<double>(shown.size());
    };
    std::vector<double> spread, before;
    for (const float l : calm) spread.push_back(l);
    for (const float l : raw) before.push_back(l);
    EXPECT_GT(specks(raw), 0.001) << signal;  // otherwise this proves nothing
    // A fifth of the mean, which has a fifth of the noise itself: of a signal of 5 and 12 that is a half and
    // a quarter, of the others a tenth; what is beyond 3.5 deviations is a speck.
    EXPECT_LT(specks(calm), signal < 10 ? 0.06 : signal < 20 ? 0.005 : 0.001) << signal;
    EXPECT_LT(spread_of(spread), signal < 10 ? 0.6 : 0.35) << signal;
    EXPECT_GT(spread_of(before), spread_of(spread)) << signal;
  }
}

TEST(StarvedPixels, ChangeNothingWhereThereIsLight) {
  StarvedPixels starved(kSize);
  starved.set_noise(kNoise);
  const std::vector<std::uint16_t> codes = noisy_codes(400, 4);
  const PixelPlane raw = logarithms_of(codes);
  EXPECT_EQ(&starved.calmed(codes, raw), &raw);
  // Beside a dark half the bright one keeps its pixels, but for those whose mean reaches into the dark.
  std::vector<std::uint16_t> half = codes;
  const std::vector<std::uint16_t> dark = noisy_codes(15, 5);
  for (int j = 0; j < kSize.height; ++j)
    for (int i = 0; i < kSize.width / 2; ++i) {
      const std::size_t at = kSize.row(j) + static_cast<std::size_t>(i);
      half[at] = dark[at];
    }
  const PixelPlane mixed = logarithms_of(half), calm = starved.calmed(half, mixed);
  for (int j = 0; j < kSize.height; ++j)
    for (int i = kSize.width / 2 + 3; i < kSize.width; ++i) {
      const std::size_t at = kSize.row(j) + static_cast<std::size_t>(i);
      ASSERT_EQ(calm[at], mixed[at]);
    }
}

TEST(DisplayWindow, FollowsTheBodyAndNothingElse) {
  DisplayWindow window(kSize);
  const PixelPlane field = plane_of([](int i, int) { return i < 400 ? 1 : 0; }),
                   left = plane_of([](int, int) { return 0.05; });
  const auto follow = [&](double brightest) {
    // The body is a ramp from 4, beside it the open field, behind blades nearly nothing.
    const PixelPlane logarithm = plane_of([&](int i, int) {
      return i >= 400 ? 0.1 : i >= 300 ? 9.5 : 4 + (brightest - 4) * i / 300;
    });
    window.begin(9.5, left, field);
    for (int j = 0; j < kSize.height; ++j) {
      const std::size_t at = kSize.row(j);
      window.count_row(j, logarithm.data() + at, logarithm.data() + at, left.data() + at, field.data() + at);
    }
    window.follow();
  };
  follow(8);
  EXPECT_NEAR(window.middle(), 6, 0.05);
  EXPECT_NEAR(window.width(), 4 * 1.12, 0.1);  // with its margins
  const float before = window.width();
  follow(6);
  EXPECT_LT(std::abs(window.width() - before), 0.2 * before);  // no flicker
  for (int frame = 0; frame < 60; ++frame) follow(6);
  EXPECT_NEAR(window.width(), 2 * 1.12, 0.1);
  window.forget();
  follow(8);
  EXPECT_NEAR(window.width(), 4 * 1.12, 0.1);
}

/// Bodies of lungs, a spine and a metal implant by seeds: optical depths, as those of water.
std::vector<float> body(std::uint32_t seed, int side) {
  std::mt19937 random(seed);
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution(low, high)(random);
  };
  const double trunk = uniform(2.5, 4.5), lung = uniform(1.2, 2.2), spine = uniform(0.8, 1.6),
               middle = uniform(-0.2, 0.2), metal = uniform(1, 3);
  std::vector<float> tau;
  for (int j = 0; j < side; ++j)
    for (int i = 0; i < side; ++i) {
      const double x = 2.0 * i / side - 1, y = 2.0 * j / side - 1;
      const double inside = std::max(0.0, 1 - std::pow(x / 1.2, 2));
      double depth = trunk * std::sqrt(inside);
      for (const double at : {-0.5, 0.5}) depth -= lung * ramp(0.3 - std::hypot(x - at, 0.6 * y), 0.02);
      depth += spine * ramp(0.12 - std::abs(x - middle), 0.01);
      depth += metal * ramp(0.05 - std::hypot(x + 0.3, y - 0.6), 0.004);
      tau.push_back(static_cast<float>(std::max(depth, 0.0)));
    }
  return tau;
}

/// Of the pixels in which there is a body.
double share_at_the_ends(const std::vector<float>& tau, const std::vector<std::uint8_t>& shown) {
  double ends = 0, all = 0;
  for (std::size_t i = 0; i < tau.size(); ++i) {
    if (tau[i] < 0.5) continue;
    ++all;
    ends += shown[i] == 0 || shown[i] == 255;
  }
  return ends / all;
}

TEST(DisplayChain, ABodysRangeIsShown) {
  constexpr int kSide = 480;
  double without = 0, most = 0;
  for (std::uint32_t seed = 0; seed < 12; ++seed) {
    FluoroscopyOptions options;
    options.c_arm = CArm::named("fixed-single-plane");
    options.seed = seed;
    const View view{.cone = Cone{785, 1200}, .width = kSide, .height = kSide, .pixel_mm = 0.616};
    const auto shown = [&](double compression) {
      options.compression = compression;
      Fluoroscope fluoroscope(options, view, WaterPath(Opacity("water", {{-1000, 0}, {0, 0.02}})));
      fluoroscope.settle(body(seed, kSide));
      return share_at_the_ends(body(seed, kSide), fluoroscope.expose(body(seed, kSide)).shown);
    };
    most = std::max(most, shown(0.6));
    without += shown(0) / 12;
  }
  EXPECT_LT(most, 0.01);
  EXPECT_GT(without, 0.05);  // otherwise these bodies prove nothing
}

/// Where a scan ends in the picture, the open beam lies beside the thickest body, with nothing between.
TEST(DisplayChain, ABodyThatEndsInThePictureIsShownAsAnyOther) {
  constexpr int kSide = 480;
  std::mt19937 random(11);
  for (std::uint32_t seed = 0; seed < 6; ++seed) {
    FluoroscopyOptions options;
    options.c_arm = CArm::named("fixed-single-plane");
    options.seed = seed;
    options.compression = 0.6;
    const View view{.cone = Cone{785, 1200}, .width = kSide, .height = kSide, .pixel_mm = 0.75};
    const int end = kSide * std::uniform_int_distribution(65, 90)(random) / 100;
    const std::vector<float> whole = body(seed, kSide);
    std::vector<float> cut = whole;
    std::fill(cut.begin() + static_cast<std::ptrdiff_t>(kSide) * end, cut.end(), 0.0f);
    const auto contrast = [&](const std::vector<float>& tau) {  // of what both bodies have
      Fluoroscope fluoroscope(options, view, WaterPath(Opacity("water", {{-1000, 0}, {0, 0.02}})));
      fluoroscope.settle(tau);
      const std::vector<std::uint8_t> shown = fluoroscope.expose(tau).shown;
      std::vector<double> greys;
      for (std::size_t i = 0; i < static_cast<std::size_t>(kSide) * static_cast<std::size_t>(end - 20); ++i)
        if (cut[i] > 0.5) greys.push_back(shown[i]);
      return spread_of(greys);
    };
    EXPECT_GT(contrast(cut), 0.85 * contrast(whole)) << seed;
  }
}

/// Trunks with or without a hip prosthesis of steel or more: a ball and a stem.
std::vector<float> hip(std::uint32_t seed, int side, bool has_metal) {
  std::mt19937 random(seed);
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution(low, high)(random);
  };
  const double trunk = uniform(3, 5), spine = uniform(0.5, 1.2), metal = uniform(3, 20),
               ball = uniform(0.08, 0.15), stem = uniform(0.03, 0.06), at_x = uniform(-0.6, 0.6),
               at_y = uniform(-0.5, 0.3);
  std::vector<float> tau;
  for (int j = 0; j < side; ++j)
    for (int i = 0; i < side; ++i) {
      const double x = 2.0 * i / side - 1, y = 2.0 * j / side - 1;
      double depth = trunk * std::sqrt(std::max(0.0, 1 - std::pow(x / 1.2, 2)));
      depth += spine * ramp(0.12 - std::abs(x), 0.01);
      const double of_ball = 1 - (std::pow(x - at_x, 2) + std::pow(y - at_y, 2)) / (ball * ball),
                   of_stem = y > at_y && y < at_y + 0.5 ? 1 - std::pow((x - at_x) / stem, 2) : 0;
      if (has_metal)
        depth += metal *
                 std::max(std::sqrt(std::max(of_ball, 0.0)), stem / ball * std::sqrt(std::max(of_stem, 0.0)));
      tau.push_back(static_cast<float>(depth));
    }
  return tau;
}

/// Greys by which a trunk's depths differ, from the right of the spine to near the picture's edge.
double anatomy_contrast(const std::vector<std::uint8_t>& shown, int side) {
  const auto mean_about = [&](double x) {
    double sum = 0, count = 0;
    for (int j = side / 16; j < side / 8; ++j)
      for (int i = -8; i <= 8; ++i, ++count)
        sum += shown[static_cast<std::size_t>(j * side + i) + static_cast<std::size_t>((x + 1) / 2 * side)];
    return sum / count;
  };
  return mean_about(0.9) - mean_about(0);
}

TEST(DisplayChain, MetalLeavesTheBodyItsContrast) {
  constexpr int kSide = 480;
  constexpr std::uint32_t kSeeds = 16;
  double sum = 0;
  for (std::uint32_t seed = 1; seed <= kSeeds; ++seed) {
    FluoroscopyOptions options;
    options.c_arm = CArm::named("fixed-single-plane");
    options.seed = seed;
    const View view{.cone = Cone{785, 1200}, .width = kSide, .height = kSide, .pixel_mm = 0.616};
    const auto shown = [&](bool has_metal) {
      const std::vector<float> tau = hip(seed, kSide, has_metal);
      Fluoroscope fluoroscope(options, view, WaterPath(Opacity("water", {{-1000, 0}, {0, 0.02}})));
      fluoroscope.settle(tau);
      return fluoroscope.expose(tau).shown;
    };
    const std::vector<std::uint8_t> with = shown(true), without = shown(false);
    EXPECT_LT(share_at_the_ends(hip(seed, kSide, true), with), 0.01) << seed;
    const double ratio = anatomy_contrast(with, kSide) / anatomy_contrast(without, kSide);
    // Metal has a twelfth of the greys; where it lies in the measuring field the exposure rises, and what it
    // hides of the body is no more in the body's range.
    EXPECT_GT(ratio, 0.75) << seed;
    EXPECT_LT(ratio, 1.15) << seed;
    sum += ratio / kSeeds;
  }
  EXPECT_GT(sum, 0.88);
}

/// The contrast in greys, on the last pulses, of a wire of steel, 0.36 mm thick, that moves by `pixels` a
/// pulse.
double wire_contrast(const CArm& c_arm, std::uint32_t seed, double pixels, double angle) {
  constexpr int kSide = 360, kPulses = 10, kShown = 4, kMargin = 60;
  constexpr double kPixel_mm = 0.3, kThick_mm = 0.36;
  constexpr double kMu_per_mm = 1, kBody = 4;  // steel's at some 60 keV, in 20 cm of water
  FluoroscopyOptions options;
  options.c_arm = c_arm;
  options.seed = seed;
  const View view{.cone = c_arm.distances, .width = kSide, .height = kSide, .pixel_mm = kPixel_mm};
  Fluoroscope fluoroscope(options, view, WaterPath(Opacity("water", {{-1000, 0}, {0, 0.02}})));
  double contrast = 0;
  for (int pulse = 0; pulse < kPulses; ++pulse) {
    const auto across_mm = [&](double i, double j) {
      return ((i - kSide / 2.0) * std::cos(angle) + (j - kSide / 2.0) * std::sin(angle) +
              (kPulses - 1 - pulse) * pixels) *
             kPixel_mm;
    };
    std::vector<float> tau;
    constexpr int kParts = 5;  // of a pixel
    for (int j = 0; j < kSide; ++j)
      for (int i = 0; i < kSide; ++i) {
        double chord_mm = 0;
        for (int part = 0; part < kParts; ++part) {
          const double from_mm = across_mm(i + (part - 2.0) / kParts, j);
          chord_mm += 2 * std::sqrt(std::max(0.0, kThick_mm * kThick_mm / 4 - from_mm * from_mm)) / kParts;
        }
        tau.push_back(static_cast<float>(kBody + kMu_per_mm * chord_mm));
      }
    if (pulse == 0) fluoroscope.settle(tau);
    const std::vector<std::uint8_t>& shown = fluoroscope.expose(tau).shown;
    if (pulse < kPulses - kShown) continue;
    double on = 0, on_count = 0, beside = 0, beside_count = 0;
    for (int j = kMargin; j < kSide - kMargin; ++j)
      for (int i = kMargin; i < kSide - kMargin; ++i) {
        const double from_mm = std::abs(across_mm(i, j));
        const double grey = shown[static_cast<std::size_t>(kSide * j + i)];
        if (from_mm < 0.2) on += grey, ++on_count;
        if (from_mm > 3 && from_mm < 8) beside += grey, ++beside_count;
      }
    contrast += (beside / beside_count - on / on_count) / kShown;
  }
  return contrast;
}

/// A filter of a constant weight of 0.4 leaves 0.4 of a wire that moves by more than its thickness a pulse.
TEST(TemporalFilter, AMovingWireKeepsItsContrast) {
  for (const char* name : {"fixed-single-plane", "mobile-flat-panel"})
    for (const double pixels : {4.0, 9.0}) {
      const CArm c_arm = CArm::named(name);
      double moving = 0, still = 0;
      for (std::uint32_t seed = 0; seed < 3; ++seed) {
        moving += wire_contrast(c_arm, seed, pixels, 0.37 * seed);
        still += wire_contrast(c_arm, seed, 0, 0.37 * seed);
      }
      // Half of the loss of 0.6, at the usual dose.
      EXPECT_GT(moving / still, 0.7) << name << ", " << pixels << " pixels a pulse";
    }
}

/// Where nothing moves, as good as a constant weight of 0.4, which leaves 0.25 of white noise's variance.
TEST(TemporalFilter, NoiseFalls) {
  std::mt19937 random(3);
  std::normal_distribution<float> normal(0, 0.1f);
  TemporalFilter filter(kSize);
  for (int frame = 0; frame < 12; ++frame) filter.add(plane_of([&](int, int) { return 5 + normal(random); }));
  const std::vector<double> average(filter.average().begin(), filter.average().end());
  // What is taken for lines by chance takes a tenth of it.
  EXPECT_LT(std::pow(spread_of(average) / 0.1, 2), 0.3);
}

/// As at the side of the lung, and beside blades, behind which nothing changes.
TEST(TemporalFilter, NoiseFallsBesideOtherNoise) {
  std::mt19937 random(4);
  std::normal_distribution<float> normal(0, 1);
  TemporalFilter filter(kSize);
  const auto noise_at = [](int i) {
    return i < kSize.width / 3 ? 0.0f : i < 2 * kSize.width / 3 ? 0.15f : 0.05f;
  };
  for (int frame = 0; frame < 12; ++frame)
    filter.add(plane_of([&](int i, int) { return 5 + noise_at(i) * normal(random); }));
  for (const int border : {kSize.width / 3, 2 * kSize.width / 3})
    for (const int from : {border - 24, border}) {
      if (noise_at(from) == 0) continue;
      std::vector<double> band;
      for (int j = 0; j < kSize.height; ++j)
        for (int i = from; i < from + 24; ++i)
          band.push_back(filter.average()[kSize.row(j) + static_cast<std::size_t>(i)]);
      // 0.25 where the noise is even; the ramps between cells take a part of the other side's.
      EXPECT_LT(std::pow(spread_of(band) / noise_at(from), 2), 0.45) << border << " " << from;
    }
}

/// Sides of what has moved are no lines, and stayed as its outline, frame after frame.
TEST(TemporalFilter, WhatHasMovedLeavesNoOutline) {
  constexpr int kFrames = 14, kStep = 16;
  std::mt19937 random(5);
  std::normal_distribution<float> normal(0, 0.02f);
  TemporalFilter filter(kSize);
  const auto wire_at = [&](int frame, int i) {
    const double from = i - (40.0 + kStep * frame);
    return -0.5 * std::exp(-0.5 * from * from / 4);  // some five pixels wide
  };
  for (int frame = 0; frame < kFrames; ++frame)
    filter.add(
        plane_of([&](int i, int) { return static_cast<float>(5 + wire_at(frame, i)) + normal(random); }));
  // Where it was in the frames before the last two, nothing of its half is seen.
  for (int frame = kFrames - 6; frame < kFrames - 2; ++frame)
    for (int by = -6; by <= 6; ++by) {
      double sum = 0;
      for (int j = 0; j < kSize.height; ++j)
        sum +=
            filter.average()[kSize.row(j) + static_cast<std::size_t>(40 + kStep * frame + by)] / kSize.height;
      // A twenty-fifth of the wire; noise of a column's mean is 0.001.
      EXPECT_NEAR(sum, 5, 0.02) << frame << " " << by;
    }
}

TEST(DisplayChain, TheBladesLeaveNoFrame) {
  constexpr int kSide = 480;
  FluoroscopyOptions options;
  options.c_arm = CArm::named("mobile-flat-panel");
  const View view{.cone = options.c_arm.distances, .width = kSide, .height = kSide, .pixel_mm = 0.4};
  const std::vector<float> tau(std::size_t{kSide} * kSide, 4.0f);
  for (const bool is_turned : {false, true}) {
    options.collimation = Collimation{120, 90, is_turned ? 0.3 : 0.0};
    Fluoroscope fluoroscope(options, view, WaterPath(Opacity("water", {{-1000, 0}, {0, 0.02}})));
    fluoroscope.settle(tau);
    const std::vector<std::uint8_t> shown = fluoroscope.expose(tau).shown;
    // Means of rings of pixels about as far from the blades.
    std::array<double, 14> sums{}, counts{};
    for (int j = 0; j < kSide; ++j)
      for (int i = 0; i < kSide; ++i) {
        const double x = (i + 0.5 - kSide / 2) * 0.4, y = (kSide / 2 - j - 0.5) * 0.4;
        const double c = std::cos(options.collimation->turn_rad), s = std::sin(options.collimation->turn_rad);
        const double inside = std::min(60 - std::abs(c * x + s * y), 45 - std::abs(c * y - s * x)) / 0.4;
        if (inside < 3 || inside >= 3 + std::ssize(sums)) continue;
        const auto ring = static_cast<std::size_t>(inside - 3);
        sums[ring] += shown[static_cast<std::size_t>(j * kSide + i)];
        counts[ring] += 1;
      }
    for (std::size_t ring = 0; ring + 1 < sums.size(); ++ring)
      // Noise of a ring's mean is 0.5; the frame had 8 to 15 greys.
      EXPECT_NEAR(sums[ring] / counts[ring], sums.back() / counts.back(), 3) << ring << " pixels";
  }
}

TEST(DisplayChain, ThePictureHasNoFrame) {
  FluoroscopyOptions options;
  options.c_arm = CArm::named("fixed-single-plane");
  constexpr int kWidth = 620, kHeight = 480;
  const double pixel_mm = options.c_arm.detector.width_mm / kWidth;
  const View view{.cone = options.c_arm.distances, .width = kWidth, .height = kHeight, .pixel_mm = pixel_mm};
  options.field_mm = options.c_arm.detector.width_mm;
  Fluoroscope fluoroscope(options, view, WaterPath(Opacity("water", {{-1000, 0}, {0, 0.02}})));
  const std::vector<float> tau(std::size_t{kWidth} * kHeight, 4.0f);
  fluoroscope.settle(tau);
  const std::vector<std::uint8_t> shown = fluoroscope.expose(tau).shown;
  const auto column = [&](int i) {
    double sum = 0;
    for (int j = 100; j < 380; ++j) sum += shown[static_cast<std::size_t>(j * kWidth + i)] / 280.0;
    return sum;
  };
  // Noise of a column's mean is 1; the frame had 20 to 60 greys.
  for (const int i : {0, 1, kWidth - 2, kWidth - 1})
    EXPECT_NEAR(column(i), column(i < 10 ? 20 : kWidth - 21), 4) << i;
}

TEST(DisplayChain, BehindTheBladesItIsBlack) {
  constexpr int kSide = 480;
  FluoroscopyOptions options;
  options.c_arm = CArm::named("mobile-flat-panel");
  options.dose = DoseLevel::low;
  options.compression = 0.6;
  const double middle_mm = 0.5 * 0.616 * kSide;
  options.collimation = Collimation{middle_mm, middle_mm};
  const View view{.cone = options.c_arm.distances, .width = kSide, .height = kSide, .pixel_mm = 0.616};
  for (std::uint32_t seed = 0; seed < 6; ++seed) {
    options.seed = seed;
    Fluoroscope fluoroscope(options, view, WaterPath(Opacity("water", {{-1000, 0}, {0, 0.02}})));
    fluoroscope.settle(body(seed, kSide));
    const auto shown = fluoroscope.expose(body(seed, kSide)).shown;
    int most = 0, inside = 0;
    for (int j = 0; j < kSide; ++j)
      for (int i = 0; i < kSide; ++i) {
        const int grey = shown[static_cast<std::size_t>(kSide * j + i)];
        const bool is_outside = std::max(std::abs(i - kSide / 2), std::abs(j - kSide / 2)) > kSide / 4 + 8;
        (is_outside ? most : inside) = std::max(is_outside ? most : inside, grey);
      }
    EXPECT_LT(most, 8);  // noise included
    EXPECT_GT(inside, 150);
  }
}

}  // namespace
}  // namespace xraycast::display_test
