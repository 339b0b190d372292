#include "xraycast/scene/annotations.hpp"

#include "xraycast/sampling/clip_space.hpp"

#include <OpenImageIO/imagebuf.h>
#include <OpenImageIO/imagebufalgo.h>
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
  namespace Algo = OIIO::ImageBufAlgo;
  OIIO::ImageBuf image(OIIO::ImageSpec(view.width, view.height, 3, OIIO::TypeDesc::UINT8), rgb.data());
  const int font = std::clamp(view.height / 30, 10, 40), margin = font / 2;
  constexpr std::array<float, 3> kInk{1.0f, 0.82f, 0.35f};
  const auto line = [&](double x1, double y1, double x2, double y2) {
    Algo::render_line(image, static_cast<int>(x1), static_cast<int>(y1), static_cast<int>(x2),
                      static_cast<int>(y2), kInk);
  };
  const auto text = [&](double x, double y, const std::string& words, Algo::TextAlignX align) {
    Algo::render_text(image, static_cast<int>(x), static_cast<int>(y), words, font, "DejaVuSans", kInk, align,
                      Algo::TextAlignY::Baseline, std::max(1, font / 12));
  };
  using enum Algo::TextAlignX;
  const double w = view.width, h = view.height;
  text(margin, 0.5 * h, annotations.left, Left);
  text(w - margin, 0.5 * h, annotations.right, Right);
  text(0.5 * w + margin, margin + font, annotations.top, Left);
  text(0.5 * w + margin, h - margin, annotations.bottom, Left);
  text(margin, h - margin, caption, Left);
  const double bar_y = h - 2 * font - margin, bar_x = w - margin;
  for (int thick = 0; thick < std::max(1, font / 10); ++thick)
    line(bar_x - annotations.bar_px, bar_y + thick, bar_x, bar_y + thick);
  line(bar_x - annotations.bar_px, bar_y - 0.3 * font, bar_x - annotations.bar_px, bar_y + 0.3 * font);
  line(bar_x, bar_y - 0.3 * font, bar_x, bar_y + 0.3 * font);
  text(bar_x, bar_y - 0.5 * font, fmt::format("{:g} mm", annotations.bar_mm), Right);
  // Ticks at the body's ends alone, so that the axis occludes nothing.
  const glm::dvec2 along = glm::normalize(annotations.axis_bottom - annotations.axis_top);
  const auto is_seen = [&](const glm::dvec2& p) { return p.x >= 0 && p.x < w && p.y >= 0 && p.y < h; };
  for (const auto& [end, tick] : {std::pair(annotations.axis_top, double(font) * along),
                                  std::pair(annotations.axis_bottom, -double(font) * along)})
    if (is_seen(end) && is_seen(end + tick)) line(end.x, end.y, end.x + tick.x, end.y + tick.y);
}

}  // namespace xraycast
