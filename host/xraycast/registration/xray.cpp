#include "xraycast/registration/xray.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/image.hpp"

#include <glm/vec2.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <utility>

namespace xraycast {
namespace {

std::size_t pixel_count(const Xray& xray) {
  return static_cast<std::size_t>(xray.width) * static_cast<std::size_t>(xray.height);
}

std::vector<std::size_t> border_of(const Xray& xray) {
  std::vector<std::size_t> border;
  const auto width = static_cast<std::size_t>(xray.width), height = static_cast<std::size_t>(xray.height);
  for (std::size_t y = 0; y < height; ++y)
    for (std::size_t x = 0; x < width; ++x)
      if (x == 0 || y == 0 || x + 1 == width || y + 1 == height) border.push_back(y * width + x);
  return border;
}

/// The pixels of about that grey which hang together with the picture's border.
std::vector<std::uint8_t> filled_from_border(const Xray& xray, float grey, float tolerance) {
  std::vector<std::uint8_t> filled(pixel_count(xray));
  std::vector<std::size_t> next;
  const auto visit = [&](std::size_t i) {
    if (filled[i] != 0 || std::abs(xray.pixels[i] - grey) > tolerance) return;
    filled[i] = 1;
    next.push_back(i);
  };
  for (const std::size_t i : border_of(xray)) visit(i);
  const auto width = static_cast<std::size_t>(xray.width);
  while (!next.empty()) {
    const std::size_t i = next.back(), x = i % width;
    next.pop_back();
    if (x > 0) visit(i - 1);
    if (x + 1 < width) visit(i + 1);
    if (i >= width) visit(i - width);
    if (i + width < filled.size()) visit(i + width);
  }
  return filled;
}

using Point = glm::dvec2;

double turn(const Point& a, const Point& b, const Point& c) {
  return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

/// Of the convex hull (Andrew's monotone chain) of points that ascend in x, then y.
double hull_area(const std::vector<Point>& points) {
  std::vector<Point> hull;
  const auto add_chain = [&](auto first, auto last) {
    const std::size_t begin = hull.size();
    for (; first != last; ++first) {
      while (hull.size() >= begin + 2 && turn(hull[hull.size() - 2], hull.back(), *first) <= 0)
        hull.pop_back();
      hull.push_back(*first);
    }
    hull.pop_back();
  };
  if (points.size() < 3) return 0;
  add_chain(points.begin(), points.end());
  add_chain(points.rbegin(), points.rend());
  double twice = 0;
  for (std::size_t i = 0; i < hull.size(); ++i) {
    const Point &a = hull[i], &b = hull[(i + 1) % hull.size()];
    twice += a.x * b.y - b.x * a.y;
  }
  return std::abs(twice) / 2;
}

/// What is not filled, as the first and the last pixel of every column say: no hole in it counts.
struct Field {
  std::vector<std::pair<int, int>> rows;  ///< of each column; {0, -1}: none
  double area = 0;                        ///< pixels
};

Field field_beside(const std::vector<std::uint8_t>& filled, const Xray& xray) {
  Field field;
  for (int x = 0; x < xray.width; ++x) {
    const auto is_field = [&](int y) {
      return filled[static_cast<std::size_t>(y) * static_cast<std::size_t>(xray.width) +
                    static_cast<std::size_t>(x)] == 0;
    };
    int first = 0, last = xray.height - 1;
    while (first <= last && !is_field(first)) ++first;
    while (last >= first && !is_field(last)) --last;
    field.rows.emplace_back(first, last);
    field.area += last - first + 1;
  }
  return field;
}

double hull_area(const Field& field) {
  std::vector<Point> corners;
  for (std::size_t x = 0; x < field.rows.size(); ++x) {
    const auto [first, last] = field.rows[x];
    if (last < first) continue;
    for (const double side : {0.0, 1.0}) {
      corners.emplace_back(static_cast<double>(x) + side, first);
      corners.emplace_back(static_cast<double>(x) + side, last + 1);
    }
  }
  std::ranges::sort(corners,
                    [](const Point& a, const Point& b) { return std::pair(a.x, a.y) < std::pair(b.x, b.y); });
  return hull_area(corners);
}

/// Blades leave a convex field, and so does an image intensifier; a body that ends in the picture mostly does
/// not.
bool is_collimated(const Field& field, const Xray& xray) {
  constexpr double kLeastFilled = 0.02, kLeastField = 0.05, kLeastConvexity = 0.96;
  const double all = static_cast<double>(pixel_count(xray));
  return field.area < (1 - kLeastFilled) * all && field.area > kLeastField * all &&
         field.area > kLeastConvexity * hull_area(field);
}

}  // namespace

void check(const Xray& xray) {
  if (xray.width < 16 || xray.height < 16 || xray.pixels.size() != pixel_count(xray))
    throw InputError("{}: must be a picture of at least 16 x 16 pixels", xray.name);
  if (!std::ranges::all_of(xray.pixels, [](float grey) { return std::isfinite(grey); }))
    throw InputError("{}: some of its pixels are not finite", xray.name);
  const auto [least, most] = std::ranges::minmax(xray.pixels);
  if (least == most) throw InputError("{}: all its pixels are {:g}; it shows nothing", xray.name, least);
  if (!xray.camera) return;
  validate(*xray.camera, xray.name);
  if (xray.camera->width != xray.width || xray.camera->height != xray.height)
    throw InputError("{}: has {} x {} pixels, and its camera {} x {}", xray.name, xray.width, xray.height,
                     xray.camera->width, xray.camera->height);
}

std::vector<std::uint8_t> collimated_field(const Xray& xray) {
  std::vector<float> border;
  for (const std::size_t i : border_of(xray)) border.push_back(xray.pixels[i]);
  constexpr double kTolerance = 0.03;  // of the greys' range; above a shutter's scatter and noise
  const float tolerance =
      static_cast<float>(kTolerance * (quantile(xray.pixels, 0.99) - quantile(xray.pixels, 0.01)));
  std::vector<std::uint8_t> mask(pixel_count(xray), 1);
  // A collimator covers more than half of the border, or its corners at least.
  for (const double share : {0.5, 0.1, 0.9}) {
    const Field field = field_beside(filled_from_border(xray, quantile(border, share), tolerance), xray);
    if (!is_collimated(field, xray)) continue;
    for (std::size_t i = 0; i < mask.size(); ++i) {
      const auto [first, last] = field.rows[i % static_cast<std::size_t>(xray.width)];
      const int y = static_cast<int>(i / static_cast<std::size_t>(xray.width));
      mask[i] = y >= first && y <= last;
    }
    return mask;
  }
  return mask;
}

}  // namespace xraycast
