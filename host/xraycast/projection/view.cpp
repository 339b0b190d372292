#include "xraycast/projection/view.hpp"

#include "xraycast/base/error.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace xraycast {
namespace {

constexpr double kDegrees = 180 / std::numbers::pi;
constexpr int kMaxSide = 16384;
// Pixel sizes within these limits are resolved by 32-bit coordinates.
constexpr double kNearestSource_mm = 1, kFarthestDetector_mm = 1e6;

void check(const View& view) {
  if (!std::isfinite(view.lao_rad) || !std::isfinite(view.cranial_rad))
    throw InputError("the view's angles must be finite");
  if (view.width < 0 || view.width > kMaxSide || view.height < 0 || view.height > kMaxSide)
    throw InputError("a picture of {} x {} pixels: each side must be 1 to {}", view.width, view.height,
                     kMaxSide);
  if (!std::isfinite(view.pixel_mm) || view.pixel_mm < 0)
    throw InputError("pixel size of {} mm must be above 0", view.pixel_mm);
  if (!view.cone) return;
  const auto [axis, detector] = *view.cone;
  if (!(axis >= kNearestSource_mm) || !(detector >= axis) || !(detector <= kFarthestDetector_mm))
    throw InputError(
        "cone {:g},{:g}: the source must be {:g} mm or more from the axis, the detector beyond the axis, "
        "within {:g} mm",
        axis, detector, kNearestSource_mm, kFarthestDetector_mm);
}

/// The number of pixels of a length. A whole number up to rounding is kept: one more would shift all pixels
/// by a half, between the rows of a map made for the same picture.
int pixels(double length_mm, double pixel_mm) {
  return static_cast<int>(std::clamp(std::ceil(length_mm / pixel_mm - 1e-6), 1.0, double(kMaxSide)));
}

}  // namespace

glm::dvec3 View::towards_detector() const {
  return {std::sin(lao_rad) * std::cos(cranial_rad), -std::cos(lao_rad) * std::cos(cranial_rad),
          std::sin(cranial_rad)};
}

glm::dvec3 View::right() const { return {std::cos(lao_rad), std::sin(lao_rad), 0}; }

glm::dvec3 View::up() const { return glm::cross(towards_detector(), right()); }

glm::dvec3 View::pixel_on_detector_mm(double i, double j) const {
  const double beyond_mm = cone ? cone->source_detector_mm - cone->source_axis_mm : 0;
  return centre_mm + beyond_mm * towards_detector() + (i + 0.5 - 0.5 * width) * pixel_mm * right() +
         (0.5 * height - j - 0.5) * pixel_mm * up();
}

glm::dvec3 View::source_mm() const { return centre_mm - cone->source_axis_mm * towards_detector(); }

std::string label(const View& view) {
  double angle = std::remainder(view.lao_rad * kDegrees, 360.0);
  const double tilt = view.cranial_rad * kDegrees;
  const auto shown = [](double degrees) {
    return fmt::format("{:g}", std::round(std::abs(degrees) * 10) / 10);
  };
  std::string text =
      std::abs(angle) < 0.05 ? "AP" : fmt::format("{} {}", angle > 0 ? "LAO" : "RAO", shown(angle));
  if (std::abs(tilt) >= 0.05) text += fmt::format(" / {} {}", tilt > 0 ? "CRA" : "CAU", shown(tilt));
  return text;
}

View fitted(View view, const VolumeGeometry& volume, const BodyOutline& body) {
  check(view);
  const double half_height_mm = 0.5 * (volume.upper_mm().z - volume.lower_mm().z);
  const double ct = std::abs(std::cos(view.cranial_rad)), st = std::abs(std::sin(view.cranial_rad));
  // A cone magnifies most the part nearest to the source.
  double magnification = 1;
  if (view.cone) {
    const double nearest_mm = view.cone->source_axis_mm - (body.radius_mm * ct + half_height_mm * st);
    magnification = view.cone->source_detector_mm / std::max(nearest_mm, 0.1 * view.cone->source_axis_mm);
  }
  const double width_mm = 2 * body.radius_mm * magnification;
  const double height_mm = 2 * (half_height_mm * ct + body.radius_mm * st) * magnification;
  if (view.pixel_mm == 0) {
    view.pixel_mm = std::min({volume.spacing_mm.x, volume.spacing_mm.y, volume.spacing_mm.z}) *
                    (view.cone ? view.cone->source_detector_mm / view.cone->source_axis_mm : 1);
    if (view.width > 0 && view.height > 0)
      view.pixel_mm = std::max(width_mm / view.width, height_mm / view.height);
    // A thin stack of fine slices would make a huge picture; the detector has only so many pixels.
    constexpr double kMaxByDefault = 4096;
    view.pixel_mm = std::max(view.pixel_mm, std::max(width_mm, height_mm) / kMaxByDefault);
  }
  if (view.width == 0) view.width = pixels(width_mm, view.pixel_mm);
  if (view.height == 0) view.height = pixels(height_mm, view.pixel_mm);
  return view;
}

}  // namespace xraycast
