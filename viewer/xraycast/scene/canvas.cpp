#include "xraycast/scene/canvas.hpp"

#include "xraycast/base/error.hpp"

#include <algorithm>
#include <cairo.h>
#include <cmath>
#include <numbers>

namespace xraycast {
namespace {

struct Deleter {
  void operator()(cairo_surface_t* surface) const { cairo_surface_destroy(surface); }
  void operator()(cairo_t* cairo) const { cairo_destroy(cairo); }
  void operator()(cairo_font_options_t* options) const { cairo_font_options_destroy(options); }
};
using CairoSurface = std::unique_ptr<cairo_surface_t, Deleter>;

CairoSurface checked(cairo_surface_t* surface) {
  CairoSurface owned(surface);
  if (const auto status = cairo_surface_status(surface); status != CAIRO_STATUS_SUCCESS)
    throw Error("a picture cannot be drawn: {}", cairo_status_to_string(status));
  return owned;
}

CairoSurface blank(int width, int height) {
  return checked(cairo_image_surface_create(CAIRO_FORMAT_RGB24, width, height));
}

/// A row of Cairo's pixels: blue in the lowest byte of a word, then green and red.
std::uint32_t* row_of(cairo_surface_t* surface, int y) {
  return reinterpret_cast<std::uint32_t*>(cairo_image_surface_get_data(surface) +
                                          std::ptrdiff_t{y} * cairo_image_surface_get_stride(surface));
}

CairoSurface surface_of(std::span<const std::uint8_t> rgb, int width, int height) {
  CairoSurface surface = blank(width, height);
  cairo_surface_flush(surface.get());
  const std::uint8_t* from = rgb.data();
  for (int y = 0; y < height; ++y) {
    std::uint32_t* row = row_of(surface.get(), y);
    for (int x = 0; x < width; ++x, from += 3)
      row[x] = std::uint32_t{from[0]} << 16 | std::uint32_t{from[1]} << 8 | from[2];
  }
  cairo_surface_mark_dirty(surface.get());
  return surface;
}

}  // namespace

struct Canvas::Drawing {
  CairoSurface surface;
  std::unique_ptr<cairo_t, Deleter> cairo;

  explicit Drawing(CairoSurface on) : surface(std::move(on)), cairo(cairo_create(surface.get())) {
    cairo_set_line_join(cairo.get(), CAIRO_LINE_JOIN_ROUND);
    cairo_set_line_cap(cairo.get(), CAIRO_LINE_CAP_ROUND);
    cairo_select_font_face(cairo.get(), "DejaVu Sans", CAIRO_FONT_SLANT_NORMAL, CAIRO_FONT_WEIGHT_NORMAL);
    // The same everywhere, whatever the user's desktop prefers.
    const std::unique_ptr<cairo_font_options_t, Deleter> options(cairo_font_options_create());
    cairo_font_options_set_antialias(options.get(), CAIRO_ANTIALIAS_GRAY);
    cairo_font_options_set_hint_style(options.get(), CAIRO_HINT_STYLE_SLIGHT);
    cairo_font_options_set_hint_metrics(options.get(), CAIRO_HINT_METRICS_ON);
    cairo_set_font_options(cairo.get(), options.get());
  }

  /// Begins a shape of its own: words leave the pen where they end.
  void begin(const Colour& colour) {
    cairo_new_path(cairo.get());
    cairo_set_source_rgb(cairo.get(), colour.red, colour.green, colour.blue);
  }

  void scaled(cairo_surface_t* picture, const PixelBox& box) {
    cairo_save(cairo.get());
    cairo_translate(cairo.get(), box.left, box.top);
    cairo_rectangle(cairo.get(), 0, 0, box.width, box.height);
    cairo_scale(cairo.get(), box.width / cairo_image_surface_get_width(picture),
                box.height / cairo_image_surface_get_height(picture));
    cairo_set_source_surface(cairo.get(), picture, 0, 0);
    cairo_pattern_set_filter(cairo_get_source(cairo.get()), CAIRO_FILTER_GOOD);
    cairo_pattern_set_extend(cairo_get_source(cairo.get()), CAIRO_EXTEND_PAD);  // otherwise borders fade
    cairo_fill(cairo.get());
    cairo_restore(cairo.get());
  }

  /// Where words begin that are aligned at a place.
  glm::dvec2 start(const glm::dvec2& at, const std::string& words, double size, Align align) {
    const double width = align == Align::left ? 0 : advance(words, size);
    return {at.x - (align == Align::centre ? 0.5 * width : width), at.y};
  }

  double advance(const std::string& words, double size) {
    cairo_set_font_size(cairo.get(), size);
    cairo_text_extents_t extents{};
    cairo_text_extents(cairo.get(), words.c_str(), &extents);
    return extents.x_advance;
  }
};

Canvas::Canvas(int width, int height, const Colour& paper)
    : drawing_(std::make_unique<Drawing>(blank(width, height))) {
  drawing_->begin(paper);
  cairo_paint(drawing_->cairo.get());
}

Canvas::Canvas(std::span<const std::uint8_t> rgb, int width, int height)
    : drawing_(std::make_unique<Drawing>(surface_of(rgb, width, height))) {}

Canvas::~Canvas() = default;

int Canvas::width() const { return cairo_image_surface_get_width(drawing_->surface.get()); }
int Canvas::height() const { return cairo_image_surface_get_height(drawing_->surface.get()); }

void Canvas::fill(const PixelBox& box, const Colour& colour) {
  drawing_->begin(colour);
  cairo_rectangle(drawing_->cairo.get(), box.left, box.top, box.width, box.height);
  cairo_fill(drawing_->cairo.get());
}

void Canvas::line(std::span<const glm::dvec2> points, const Colour& colour, double thickness,
                  std::span<const double> dashes) {
  drawing_->begin(colour);
  cairo_set_dash(drawing_->cairo.get(), dashes.data(), static_cast<int>(dashes.size()), 0);
  cairo_set_line_width(drawing_->cairo.get(), thickness);
  for (const glm::dvec2& point : points) cairo_line_to(drawing_->cairo.get(), point.x, point.y);
  cairo_stroke(drawing_->cairo.get());
  cairo_set_dash(drawing_->cairo.get(), nullptr, 0, 0);
}

void Canvas::spot(const glm::dvec2& centre, double radius, const Colour& colour) {
  drawing_->begin(colour);
  cairo_arc(drawing_->cairo.get(), centre.x, centre.y, radius, 0, 2 * std::numbers::pi);
  cairo_fill(drawing_->cairo.get());
}

void Canvas::picture(std::span<const std::uint8_t> rgb, int width, int height, const PixelBox& box) {
  drawing_->scaled(surface_of(rgb, width, height).get(), box);
}

void Canvas::text(const glm::dvec2& at, const std::string& words, double size, const Colour& colour,
                  Align align) {
  const glm::dvec2 start = drawing_->start(at, words, size, align);
  drawing_->begin(colour);
  cairo_set_font_size(drawing_->cairo.get(), size);
  cairo_move_to(drawing_->cairo.get(), std::round(start.x), std::round(start.y));
  cairo_show_text(drawing_->cairo.get(), words.c_str());
}

void Canvas::rimmed_text(const glm::dvec2& at, const std::string& words, double size, const Colour& colour,
                         double rim, Align align) {
  const glm::dvec2 start = drawing_->start(at, words, size, align);
  drawing_->begin({0, 0, 0});
  cairo_set_font_size(drawing_->cairo.get(), size);
  cairo_move_to(drawing_->cairo.get(), std::round(start.x), std::round(start.y));
  cairo_text_path(drawing_->cairo.get(), words.c_str());
  cairo_set_line_width(drawing_->cairo.get(), 2 * rim);
  cairo_stroke(drawing_->cairo.get());
  text(at, words, size, colour, align);
}

double Canvas::text_width(const std::string& words, double size) { return drawing_->advance(words, size); }

std::vector<std::uint8_t> Canvas::rgb() const {
  if (const auto status = cairo_status(drawing_->cairo.get()); status != CAIRO_STATUS_SUCCESS)
    throw Error("a picture cannot be drawn: {}", cairo_status_to_string(status));
  cairo_surface_flush(drawing_->surface.get());
  std::vector<std::uint8_t> rgb;
  rgb.reserve(std::size_t{3} * width() * height());
  for (int y = 0; y < height(); ++y)
    for (const std::uint32_t pixel : std::span(row_of(drawing_->surface.get(), y), width()))
      rgb.insert(rgb.end(), {static_cast<std::uint8_t>(pixel >> 16), static_cast<std::uint8_t>(pixel >> 8),
                             static_cast<std::uint8_t>(pixel)});
  return rgb;
}

}  // namespace xraycast
