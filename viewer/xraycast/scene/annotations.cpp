#include "xraycast/scene/annotations.hpp"

#include "xraycast/sampling/clip_space.hpp"
#include "xraycast/scene/canvas.hpp"

#include <fmt/format.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>

namespace xraycast {
namespace {

/// The largest of 1, 2 or 5 times a power of ten that does not exceed `limit`.
double round_length(double limit) {
  const double decade = std::pow(10, std::floor(std::log10(limit)));
  for (const double times : {5.0, 2.0})
    if (times * decade <= limit) return times * decade;
  return decade;
}

}  // namespace

std::string orientation_label(const glm::dvec3& direction) {
  struct Component {
    double size;
    char letter;
  };
  const glm::dvec3 along = glm::normalize(direction);
  std::array<Component, 3> components{{{std::abs(along.x), along.x > 0 ? 'L' : 'R'},
                                       {std::abs(along.y), along.y > 0 ? 'P' : 'A'},
                                       {std::abs(along.z), along.z > 0 ? 'S' : 'I'}}};
  std::ranges::sort(components, std::greater{}, &Component::size);
  std::string label;
  constexpr double kMinComponent = 0.26;  // the sine of 15 deg
  for (const Component& component : components)
    if (component.size > kMinComponent) label += component.letter;
  return label;
}

Annotations annotations_of(const View& view, const glm::dvec3& axis_top_mm,
                           const glm::dvec3& axis_bottom_mm) {
  Annotations annotations;
  annotations.right = orientation_label(view.right());
  annotations.left = orientation_label(-view.right());
  annotations.top = orientation_label(view.up());
  annotations.bottom = orientation_label(-view.up());
  annotations.axis_top = pixel_of(view, axis_top_mm);
  annotations.axis_bottom = pixel_of(view, axis_bottom_mm);
  const double magnification = view.cone ? view.cone->source_detector_mm / view.cone->source_axis_mm : 1;
  const double at_axis_mm = view.pixel_mm / magnification;
  annotations.bar_mm = round_length(0.25 * view.width * at_axis_mm);
  annotations.bar_px = annotations.bar_mm / at_axis_mm;
  return annotations;
}

void draw_annotations(std::span<std::uint8_t> rgb, const View& view, const Annotations& annotations,
                      const std::string& caption) {
  Canvas canvas(rgb, view.width, view.height);
  const int font = std::clamp(view.height / 30, 10, 40), margin = font / 2;
  constexpr Colour kInk{1, 0.82, 0.35};
  const double thickness = std::max(1, font / 10);
  const double rim = std::max(1, font / 12);  // black, which sets all of it off from light ground
  using Line = std::array<glm::dvec2, 2>;
  const auto draw = [&](std::initializer_list<Line> lines) {
    for (const Line& line : lines) canvas.line(line, {0, 0, 0}, thickness + 2 * rim);
    for (const Line& line : lines) canvas.line(line, kInk, thickness);
  };
  const auto text = [&](double x, double y, const std::string& words, Align align) {
    canvas.rimmed_text({x, y}, words, font, kInk, rim, align);
  };
  using enum Align;
  const double w = view.width, h = view.height;
  text(margin, 0.5 * h, annotations.left, left);
  text(w - margin, 0.5 * h, annotations.right, right);
  text(0.5 * w + margin, margin + font, annotations.top, left);
  text(0.5 * w + margin, h - margin, annotations.bottom, left);
  text(margin, h - margin, caption, left);
  // Crisp where the thickness is odd: a line of one pixel runs through pixels' middles.
  const double bar_y = h - 2 * font - margin + 0.5 * thickness, bar_x = w - margin - 0.5 * thickness,
               bar_left = std::floor(bar_x - annotations.bar_px) + 0.5 * thickness,
               tick = std::round(0.3 * font);
  const glm::dvec2 left_end(bar_left, bar_y), right_end(bar_x, bar_y), half(0, tick);
  draw({Line{left_end, right_end}, Line{left_end - half, left_end + half},
        Line{right_end - half, right_end + half}});
  text(w - margin, bar_y - 0.5 * font, fmt::format("{:g} mm", annotations.bar_mm), right);
  // The axis is marked at the body's ends alone, so that it hides nothing.
  const glm::dvec2 along = glm::normalize(annotations.axis_bottom - annotations.axis_top);
  const auto is_seen = [&](const glm::dvec2& p) { return p.x >= 0 && p.x < w && p.y >= 0 && p.y < h; };
  for (const auto& [end, mark] : {std::pair(annotations.axis_top, double(font) * along),
                                  std::pair(annotations.axis_bottom, -double(font) * along)})
    if (is_seen(end) && is_seen(end + mark)) draw({Line{end, end + mark}});
  std::ranges::copy(canvas.rgb(), rgb.begin());
}

void annotate(std::span<std::uint8_t> rgb, const View& view, const BodyBounds& bounds,
              const std::string& caption) {
  const glm::dvec3 half(0, 0, bounds.half_height_mm);
  draw_annotations(rgb, view, annotations_of(view, bounds.centre_mm + half, bounds.centre_mm - half),
                   caption);
}

}  // namespace xraycast
