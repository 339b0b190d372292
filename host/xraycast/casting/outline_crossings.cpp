#include "xraycast/casting/outline_crossings.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace xraycast {
namespace {

constexpr double kWholeTurn = 2 * std::numbers::pi;
// An outline bends little within such an angle, so that a line crosses a shell once in it, if at all.
constexpr double kStep_rad = kWholeTurn * 3 / 360;

}  // namespace

OutlineCrossings::OutlineCrossings(const MapGeometry& geometry, int row) : width_(geometry.width) {
  for (int column = 0; column <= width_; ++column) scale_.push_back(geometry.scale(column % width_, row));
}

double OutlineCrossings::scale_at(double column) const {
  const double turned = column - width_ * std::floor(column / width_);
  const auto left = std::min(static_cast<std::size_t>(turned), scale_.size() - 2);
  return std::lerp(scale_[left], scale_[left + 1], turned - static_cast<double>(left));
}

OutlineCrossings::Line::Line(const OutlineCrossings& outline, const glm::dvec2& foot_mm,
                             const glm::dvec2& direction)
    : outline_(&outline), offset_mm_(glm::length(foot_mm)) {
  // Through the axis the foot has no direction of its own, but the line's normal serves.
  const bool is_left = direction.x * foot_mm.y - direction.y * foot_mm.x > 0;
  const glm::dvec2 normal =
      is_left ? glm::dvec2(-direction.y, direction.x) : glm::dvec2(direction.y, -direction.x);
  const double per_rad = outline.width_ / kWholeTurn;
  foot_column_ = std::atan2(normal.x, -normal.y) * per_rad - 0.5;
  // phi grows along (cos phi, sin phi) = (-normal.y, normal.x).
  columns_per_rad_ = glm::dot(direction, glm::dvec2(-normal.y, normal.x)) > 0 ? per_rad : -per_rad;
}

double OutlineCrossings::Line::shell_radius_mm(double along_mm, double column) const {
  return std::sqrt(along_mm * along_mm + offset_mm_ * offset_mm_) / outline_->scale_at(column);
}

std::vector<OutlineCrossings::Crossing> OutlineCrossings::crossings(const Line& line,
                                                                    std::span<const double> radii_mm) const {
  std::vector<Crossing> found;
  const double offset = line.offset_mm_, outermost = radii_mm.back();
  if (outermost <= offset) return found;
  // A hair farther, or rounding might leave out the last crossing where R is the largest.
  const double end = outermost * (1 + 1e-7);
  const double half_mm = std::sqrt((end - offset) * (end + offset));
  const int steps = static_cast<int>(std::ceil(std::atan2(half_mm, offset) / kStep_rad));
  const auto node_mm = [&](int i) {
    return std::abs(i) == steps ? std::copysign(half_mm, i) : offset * std::tan(i * kStep_rad);
  };
  const auto at_node = [&](int i, double along_mm) {
    return std::abs(i) == steps ? line.shell_radius_mm(along_mm)
                                : line.shell_radius_mm(along_mm, line.column_at(i * kStep_rad));
  };

  /// The place between two others whose radius is wanted; rho is nearly linear there.
  const auto place_of = [&](double radius_mm, double a, double at_a, double b, double at_b) {
    for (int i = 0; i < 3; ++i) {
      const double middle = a + (b - a) * std::clamp((radius_mm - at_a) / (at_b - at_a), 0.0, 1.0);
      const double at_middle = line.shell_radius_mm(middle);
      if (std::abs(at_middle - radius_mm) < 1e-7 * outermost) return middle;
      if ((at_middle < radius_mm) == (at_a < radius_mm))
        a = middle, at_a = at_middle;
      else
        b = middle, at_b = at_middle;
    }
    return a + (b - a) * std::clamp((radius_mm - at_a) / (at_b - at_a), 0.0, 1.0);
  };

  double from = node_mm(-steps), at_from = at_node(-steps, from);
  for (int i = 1 - steps; i <= steps; ++i) {
    const double to = node_mm(i), at_to = at_node(i, to);
    const auto [low, high] = std::minmax(at_from, at_to);
    const auto first = std::ranges::upper_bound(radii_mm, low) - radii_mm.begin(),
               last = std::ranges::upper_bound(radii_mm, high) - radii_mm.begin();
    for (auto n = first; n < last; ++n) {
      const auto radius = at_to > at_from ? n : first + last - 1 - n;
      found.push_back({place_of(radii_mm[radius], from, at_from, to, at_to), static_cast<int>(radius)});
    }
    from = to;
    at_from = at_to;
  }
  return found;
}

}  // namespace xraycast
