#include "xraycast/fluoroscope/detector_view.hpp"

#include "xraycast/fluoroscope/blur_stage.hpp"

#include <algorithm>
#include <cmath>
#include <functional>

namespace xraycast {
namespace {

constexpr double kUnlimited_mm = 1e6;

/// The zoom field that limits the beam; without one nothing does.
struct FieldLimit {
  Collimation sides{kUnlimited_mm, kUnlimited_mm};
  double round_mm = 0;

  explicit FieldLimit(const FluoroscopyOptions& options) {
    if (!(options.field_mm > 0)) return;
    const FluoroscopyDetector& detector = options.c_arm.detector;
    sides.width_mm = std::min(options.field_mm, detector.width_mm);
    sides.height_mm = std::min(options.field_mm, detector.height_mm);
    if (detector.is_round) round_mm = options.field_mm;
  }
};

/// Without the sides that end where the picture does, so that no penumbra frames it.
Collimation within_picture(Collimation sides, const View& view) {
  if (sides.width_mm > (view.width - 1) * view.pixel_mm) sides.width_mm = kUnlimited_mm;
  if (sides.height_mm > (view.height - 1) * view.pixel_mm) sides.height_mm = kUnlimited_mm;
  return sides;
}

PixelPlane field_of(const FluoroscopyOptions& options, const View& view) {
  const EdgeProfile edge =
      options.stages.blur ? edge_behind_scintillator(options.c_arm, view.pixel_mm) : EdgeProfile();
  const FieldLimit limit(options);
  PixelPlane field = open_field(view, within_picture(limit.sides, view), limit.round_mm, edge);
  if (!options.collimation) return field;
  const PixelPlane between = open_field(view, *options.collimation, 0, edge);
  std::transform(field.begin(), field.end(), between.begin(), field.begin(), std::multiplies{});
  return field;
}

/// The opening of turned blades through its middle, across the picture.
double opening_mm(double along_mm, double across_mm, double turn_rad) {
  constexpr double kParallel = 1e-6;
  const double cosine = std::abs(std::cos(turn_rad)), sine = std::abs(std::sin(turn_rad));
  return std::min(along_mm / std::max(cosine, kParallel), across_mm / std::max(sine, kParallel));
}

PictureSize size_in_pixels(const FluoroscopyDetector& detector, double pixel_mm) {
  constexpr double kMost = 1e6;  // of a pixel that is tiny
  const auto pixels = [&](double mm) { return static_cast<int>(std::clamp(mm / pixel_mm, 1.0, kMost)); };
  return {pixels(detector.width_mm), pixels(detector.height_mm)};
}

}  // namespace

DetectorView::DetectorView(const FluoroscopyOptions& options, const View& view)
    : size{view.width, view.height},
      pixel_mm(view.pixel_mm),
      field(field_of(options, view)),
      measured(field, size, size_in_pixels(options.c_arm.detector, view.pixel_mm)) {
  const FieldLimit limit(options);
  const Collimation blades = options.collimation.value_or(limit.sides);
  // Without a zoom field and blades the beam is as large as the picture, but no larger than the detector.
  const bool is_limited = options.field_mm > 0 || options.collimation;
  const FluoroscopyDetector& detector = options.c_arm.detector;
  const double width_mm =
      std::min(detector.width_mm, is_limited ? limit.sides.width_mm : view.width * view.pixel_mm);
  const double height_mm =
      std::min(detector.height_mm, is_limited ? limit.sides.height_mm : view.height * view.pixel_mm);
  constexpr double kCm2_per_mm2 = 0.01;
  open_area_cm2 = kCm2_per_mm2 * open_area_mm2(blades, width_mm, height_mm, limit.round_mm);
  beam_width_mm = std::min(width_mm, opening_mm(blades.width_mm, blades.height_mm, blades.turn_rad));
  beam_height_mm = std::min(height_mm, opening_mm(blades.height_mm, blades.width_mm, blades.turn_rad));
}

}  // namespace xraycast
