#pragma once

#include <glm/vec2.hpp>

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace xraycast {

/// RGB components, 0 to 1.
struct Colour {
  double red, green, blue;
};

enum class Align { left, centre, right };

/// A rectangle of a picture, in pixels.
struct PixelBox {
  double left, top, width, height;
};

/// A picture for drawing lines, other pictures and text. Lengths are in pixels; (0, 0) is the picture's upper
/// left corner, and so (0.5, 0.5) the middle of its first pixel, through which a crisp line of one pixel
/// runs. Edges are smoothed. Throws Error when there is no memory for it.
class Canvas {
 public:
  Canvas(int width, int height, const Colour& paper);

  /// Starts from 8-bit RGB, row 0 on top.
  Canvas(std::span<const std::uint8_t> rgb, int width, int height);
  ~Canvas();
  Canvas(const Canvas&) = delete;
  Canvas& operator=(const Canvas&) = delete;

  int width() const;
  int height() const;

  void fill(const PixelBox& box, const Colour& colour);

  /// A line from point to point, with round joins and ends; with `dashes` of strokes and gaps by turns.
  void line(std::span<const glm::dvec2> points, const Colour& colour, double thickness = 1,
            std::span<const double> dashes = {});

  /// A disc.
  void spot(const glm::dvec2& centre, double radius, const Colour& colour);

  /// Another picture, 8-bit RGB, scaled to a box. At its own size and whole pixels its values are unchanged.
  void picture(std::span<const std::uint8_t> rgb, int width, int height, const PixelBox& box);

  /// Text in a sans-serif font of `size` pixels. `at` is on their baseline, at their left, middle or right.
  void text(const glm::dvec2& at, const std::string& words, double size, const Colour& colour,
            Align align = Align::left);

  /// Text with a black rim of `rim` pixels, legible on any background.
  void rimmed_text(const glm::dvec2& at, const std::string& words, double size, const Colour& colour,
                   double rim, Align align = Align::left);

  /// The width of a text drawn by `text`.
  double text_width(const std::string& words, double size);

  /// The picture: 8-bit RGB, row 0 on top.
  std::vector<std::uint8_t> rgb() const;

 private:
  struct Drawing;
  std::unique_ptr<Drawing> drawing_;
};

}  // namespace xraycast
