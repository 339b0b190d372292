#pragma once

#include "xraycast/projection/view.hpp"
#include "xraycast/sampling/c_arm_pose.hpp"

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace xraycast {

/// The patient's side that a direction points to, as in DICOM's Patient Orientation: `L`, or `LA` between
/// left and anterior, the larger component first; R L A P S I.
std::string orientation_label(const glm::dvec3& direction);

/// The annotations of a picture, in its pixels, row 0 on top: orientation letters at its edges, the body's
/// axis, and a scale bar of a round number of millimetres in the plane of the axis.
struct Annotations {
  std::string left, right, top, bottom;
  glm::dvec2 axis_top, axis_bottom;
  double bar_mm = 0, bar_px = 0;
};

/// `axis_top_mm` and `axis_bottom_mm` are the ends of the body's axis.
Annotations annotations_of(const View& view, const glm::dvec3& axis_top_mm, const glm::dvec3& axis_bottom_mm);

/// Those of a body, drawn into an 8-bit RGB picture of the view's size, with a caption below on the left.
void annotate(std::span<std::uint8_t> rgb, const View& view, const BodyBounds& bounds,
              const std::string& caption);
void draw_annotations(std::span<std::uint8_t> rgb, const View& view, const Annotations& annotations,
                      const std::string& caption);

}  // namespace xraycast
