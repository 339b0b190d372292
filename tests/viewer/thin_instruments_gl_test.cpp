// Wires and catheters thinner than a pixel, or about as thin.
#include "xraycast/drawing/headless_context.hpp"
#include "xraycast/drawing/renderer.hpp"
#include "xraycast/scene/catheter_surface.hpp"

#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <vector>

namespace xraycast::thin_instruments_gl_test {
namespace {

constexpr double kWire_mm = 0.18, kRadians = std::numbers::pi / 180;  // a wire of 0.014 inch
constexpr int kPixels = 161, kSeen = 50;                              // rows or columns that are looked at

/// A rod in the plane of the view's centre, far longer than the part that is looked at, shifted across.
Surface rod(double radius_mm, double angle_deg, double pixel_mm, double shift_pixels) {
  const glm::dvec3 along(std::sin(angle_deg * kRadians), 0, std::cos(angle_deg * kRadians));
  const glm::dvec3 across(along.z, 0, -along.x);
  std::vector<glm::dvec3> nodes_mm;
  for (int i = -8; i <= 8; ++i) nodes_mm.push_back(pixel_mm * (10.0 * i * along + shift_pixels * across));
  return catheter_surface(nodes_mm, radius_mm);
}

View view_of(double pixel_mm, std::optional<Cone> cone) {
  View view{.cone = cone, .width = kPixels, .height = kPixels, .pixel_mm = pixel_mm};
  if (cone) view.pixel_mm *= cone->source_detector_mm / cone->source_axis_mm;
  return view;
}

/// Sums of the rows that a steep rod crosses, or the columns that a flat one does.
std::vector<double> sums_across(const std::vector<float>& values, double angle_deg) {
  const bool is_steep = std::abs(std::cos(angle_deg * kRadians)) > std::sqrt(0.5) - 1e-9;
  std::vector<double> sums;
  for (int a = (kPixels - kSeen) / 2; a < (kPixels + kSeen) / 2; ++a) {
    double sum = 0;
    for (int b = 0; b < kPixels; ++b) sum += values[is_steep ? a * kPixels + b : b * kPixels + a];
    sums.push_back(sum);
  }
  return sums;
}

class ThinInstruments : public testing::Test {
 protected:
  HeadlessContext context_;
  Renderer renderer_;

  std::vector<double> tau_across(const Surface& surface, double angle_deg, double pixel_mm,
                                 std::optional<Cone> cone) {
    renderer_.set_surfaces(std::vector{surface});
    return sums_across(renderer_.tau(view_of(pixel_mm, cone), {}), angle_deg);
  }
};

TEST_F(ThinInstruments, AWireIsWithoutGapsAndAbsorbsWhatItHolds) {
  for (const auto& cone : {std::optional<Cone>(), std::optional(Cone{780, 1200})})
    for (const double pixel_mm : {0.3, 0.5, 1.0, 2.0})
      for (const double angle_deg : {0.0, 3.0, 20.0, 45.0, 77.0, 90.0, 130.0}) {
        const double slant =
            std::max(std::abs(std::cos(angle_deg * kRadians)), std::abs(std::sin(angle_deg * kRadians)));
        double sum = 0, least = 1e9;
        int count = 0;
        constexpr int kShifts = 8;
        for (int shift = 0; shift < kShifts; ++shift) {
          const Surface wire = rod(kWire_mm, angle_deg, pixel_mm, (shift + 0.5) / kShifts);
          // A row crosses the wire at a slant, and so for longer.
          const double closed = wire.mu_per_mm * std::numbers::pi * kWire_mm * kWire_mm / pixel_mm / slant;
          for (const double across : tau_across(wire, angle_deg, pixel_mm, cone)) {
            sum += across / closed;
            least = std::min(least, across / closed);
            ++count;
          }
        }
        // One row's rays are at one phase of the pixels: 0.75 is the least for any direction and roll of the
        // tube (thin_tube.hpp); under a cone the tube is a little wider than that.
        EXPECT_GT(least, 0.7) << pixel_mm << " mm, " << angle_deg << " deg";
        // The mean over the phases is the integral; eight of them miss it by up to 2 %, and the view's cone
        // adds the secant of its rays, below 1 %.
        EXPECT_NEAR(sum / count, 1, 0.05) << pixel_mm << " mm, " << angle_deg << " deg";
      }
}

TEST_F(ThinInstruments, AWireIsShadedWithoutGaps) {
  Style style;
  style.look = Look::surface;
  for (const double pixel_mm : {0.3, 0.5, 1.0, 2.0})
    for (const double angle_deg : {0.0, 3.0, 20.0, 45.0, 77.0, 90.0, 130.0})
      for (const double shift : {0.0, 0.25, 0.5, 0.75}) {
        renderer_.set_surfaces(std::vector{rod(kWire_mm, angle_deg, pixel_mm, shift)});
        const std::vector<std::uint8_t> rgb = renderer_.picture(view_of(pixel_mm, {}), style);
        std::vector<float> covered;  // by the wire, which is not grey
        for (std::size_t i = 0; i < rgb.size(); i += 3) covered.push_back(rgb[i] != rgb[i + 2]);
        for (const double pixels : sums_across(covered, angle_deg)) {
          EXPECT_GE(pixels, 1) << pixel_mm << " mm, " << angle_deg << " deg, shifted by " << shift;
          // A width of 1.22 pixels, seen at up to 45 deg, covers two middles.
          EXPECT_LE(pixels, 2) << pixel_mm << " mm, " << angle_deg << " deg, shifted by " << shift;
        }
      }
}

TEST_F(ThinInstruments, AThickCatheterIsDrawnAsItIs) {
  for (const double radius_pixels : {1.3, 2.0, 5.0}) {
    const Surface catheter = rod(radius_pixels * 0.5, 20, 0.5, 0.3);
    Surface plain = catheter;
    plain.tube_sides = 0;
    std::vector<float> tau[2];
    std::vector<std::uint8_t> shaded[2];
    Style surface;
    surface.look = Look::surface;
    for (int i = 0; i < 2; ++i) {
      renderer_.set_surfaces(std::vector{i == 0 ? catheter : plain});
      tau[i] = renderer_.tau(view_of(0.5, {}), {});
      shaded[i] = renderer_.picture(view_of(0.5, {}), surface);
    }
    EXPECT_EQ(tau[0], tau[1]) << radius_pixels;
    EXPECT_EQ(shaded[0], shaded[1]) << radius_pixels;
  }
}

TEST_F(ThinInstruments, AWireDarkensWhatItLiesIn) {
  // A catheter of 0.5 mm radius in blood that absorbs a tenth of what it does, and a wire in it that absorbs
  // ten times as much; pixels of 2 mm.
  constexpr double kPixel_mm = 2, kMu_per_mm = 0.1;
  double sums[3]{};
  constexpr int kShifts = 16;
  for (int shift = 0; shift < kShifts; ++shift) {
    Surface blood = rod(10, 0, kPixel_mm, 0), catheter = rod(0.5, 0, kPixel_mm, (shift + 0.5) / kShifts),
            wire = rod(kWire_mm, 0, kPixel_mm, (shift + 0.5) / kShifts);
    blood.mu_per_mm = 0.1 * kMu_per_mm;
    catheter.mu_per_mm = kMu_per_mm;
    wire.mu_per_mm = 10 * kMu_per_mm;
    const std::vector<std::vector<Surface>> scenes{{blood}, {blood, catheter}, {blood, catheter, wire}};
    for (std::size_t s = 0; s < scenes.size(); ++s) {
      renderer_.set_surfaces(scenes[s]);
      const auto across = sums_across(renderer_.tau(view_of(kPixel_mm, {}), {}), 0);
      sums[s] += kPixel_mm * across[kSeen / 2] / kShifts;
    }
  }
  const double catheter_mm2 = std::numbers::pi * 0.25, wire_mm2 = std::numbers::pi * kWire_mm * kWire_mm;
  // The phases of a row, 2 %; and thin tubes in each other know of each other only what they fill of a pixel:
  // of the catheter, which the wire displaces a tenth of itself.
  EXPECT_NEAR(sums[1] - sums[0], 0.9 * kMu_per_mm * catheter_mm2, 0.05 * 0.9 * kMu_per_mm * catheter_mm2);
  EXPECT_NEAR(sums[2] - sums[1], 9 * kMu_per_mm * wire_mm2, 0.12 * 9 * kMu_per_mm * wire_mm2);
}

TEST_F(ThinInstruments, ATubeHasRings) {
  Surface wire = rod(kWire_mm, 0, 1, 0);
  wire.tube_sides = 7;
  EXPECT_ANY_THROW(renderer_.set_surfaces(std::vector{wire}));
}

}  // namespace
}  // namespace xraycast::thin_instruments_gl_test
