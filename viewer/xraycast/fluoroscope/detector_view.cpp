#include "xraycast/fluoroscope/detector_view.hpp"

#include <algorithm>
#include <functional>

namespace xraycast {
namespace {

/// The zoom field that limits the beam, with the detector's outline.
struct FieldLimit {
  Collimation sides;
  double round_mm = 0;

  explicit FieldLimit(const FluoroscopyOptions& options) {
    constexpr double kUnlimited_mm = 1e6;
    const FluoroscopyDetector& detector = options.c_arm.detector;
    const bool has_field = options.field_mm > 0;
    sides.width_mm = has_field ? std::min(options.field_mm, detector.width_mm) : kUnlimited_mm;
    sides.height_mm = has_field ? std::min(options.field_mm, detector.height_mm) : kUnlimited_mm;
    if (has_field && detector.is_round) round_mm = options.field_mm;
  }
};

PixelPlane field_of(const FluoroscopyOptions& options, const View& view) {
  const double spread_mm = options.stages.blur ? focal_spread_mm(options.c_arm) : 0;
  const FieldLimit limit(options);
  PixelPlane field = open_field(view, limit.sides, limit.round_mm, spread_mm);
  if (!options.collimation) return field;
  const PixelPlane between = open_field(view, *options.collimation, 0, spread_mm);
  std::ranges::transform(field, between, field.begin(), std::multiplies{});
  return field;
}

/// Without a zoom field the beam is as large as the picture.
double area_cm2(const FluoroscopyOptions& options, const View& view) {
  constexpr double kCm2_per_mm2 = 0.01;
  const FieldLimit limit(options);
  const bool has_field = options.field_mm > 0;
  const double width_mm = has_field ? limit.sides.width_mm : view.width * view.pixel_mm;
  const double height_mm = has_field ? limit.sides.height_mm : view.height * view.pixel_mm;
  return kCm2_per_mm2 *
         open_area_mm2(options.collimation.value_or(limit.sides), width_mm, height_mm, limit.round_mm);
}

}  // namespace

DetectorView::DetectorView(const FluoroscopyOptions& options, const View& view)
    : size{view.width, view.height},
      pixel_mm(view.pixel_mm),
      field(field_of(options, view)),
      open_area_cm2(area_cm2(options, view)),
      measured(field, size) {}

}  // namespace xraycast
