#include "xraycast/sampling/column_samples.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/sampling/shell_halves.hpp"
#include "xraycast/sampling/shell_pieces.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

namespace xraycast {
namespace {

constexpr double kTurn = 2 * std::numbers::pi;

/// One column's rays, seen from above.
struct Line {
  glm::dvec2 foot_mm;  ///< from the map's axis to the nearest point of the line
  glm::dvec2 direction;
  double foot_s_mm;  ///< that point's s (RectifiedView)

  glm::dvec2 at(double along_mm) const { return foot_mm + along_mm * direction; }
  double offset_mm() const { return glm::length(foot_mm); }
};

Line line_of(const RectifiedView& rectified, int column, const glm::dvec2& axis_mm) {
  const glm::dvec2 direction = rectified.direction(column), from_axis = rectified.origin_mm(column) - axis_mm;
  const double foot_s = -glm::dot(from_axis, direction);
  return {from_axis + foot_s * direction, direction, foot_s};
}

class Sampler {
 public:
  Sampler(const MapGeometry& geometry, const SampleOptions& options, std::vector<ColumnSample>& out)
      : geometry_(geometry),
        options_(options),
        profile_(geometry.radii_mm, options.reconstruction),
        out_(out) {}

  void sample(const Line& line) {
    if (options_.compositing == Compositing::wall)
      sample_walls(line);
    else
      sample_path(line);
  }

 private:
  /// A sample at `along_mm` that integrates the interval [from_mm, to_mm] of the line.
  void add(const Line& line, double along_mm, double from_mm, double to_mm, double weight,
           RadialProfile::LayerPosition position) {
    const glm::dvec2 p = line.at(along_mm);
    const double turn = std::atan2(p.x, -p.y) / kTurn;
    double column = turn * geometry_.width - 0.5;
    if (column < 0) column += geometry_.width;
    const double first = std::floor(column);
    out_.push_back({static_cast<float>(position.layer * (geometry_.width + 1) + first),
                    static_cast<float>(weight), static_cast<float>(column - first),
                    static_cast<float>(position.fraction), static_cast<float>(line.foot_s_mm + along_mm),
                    static_cast<float>(line.foot_s_mm + from_mm), static_cast<float>(line.foot_s_mm + to_mm),
                    0});
  }

  void sample_walls(const Line& line) {
    const double scale = options_.wall_radius_mm.value_or(geometry_.radius_mm()) / geometry_.radius_mm();
    for (const int side : {-1, 1})
      for (int k = 0; k < geometry_.layers(); ++k) {
        const int layer = side < 0 ? geometry_.layers() - 1 - k : k;
        const double radius = scale * geometry_.radii_mm[layer + 1], offset = line.offset_mm();
        if (radius <= offset) continue;
        const double along = side * std::sqrt((radius - offset) * (radius + offset));
        add(line, along, along, along, 1, {layer, 0});
      }
  }

  /// The interval of a line within the scan's field of view.
  std::pair<double, double> within_field(const Line& line) const {
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    std::pair<double, double> range{-kInfinity, kInfinity};
    for (int axis = 0; geometry_.field && axis < 2; ++axis) {
      const double start = geometry_.centre_mm[0][axis] + line.foot_mm[axis], slope = line.direction[axis];
      const double low = geometry_.field->lower_mm[axis] - start,
                   high = geometry_.field->upper_mm[axis] - start;
      if (slope == 0) {
        if (low > 0 || high < 0) return {0, 0};
        continue;
      }
      range.first = std::max(range.first, std::min(low / slope, high / slope));
      range.second = std::min(range.second, std::max(low / slope, high / slope));
    }
    return range;
  }

  void sample_path(const Line& line) {
    const std::vector<double> knots_mm = profile_.knots_mm();
    const double offset = line.offset_mm();
    const auto [enters_mm, leaves_mm] = within_field(line);
    for (ShellPiece piece : shell_pieces(knots_mm, offset)) {
      piece.from_mm = std::max(piece.from_mm, enters_mm);
      piece.to_mm = std::min(piece.to_mm, leaves_mm);
      if (piece.from_mm >= piece.to_mm) continue;
      const double turned = std::abs(std::atan2(piece.to_mm, offset) - std::atan2(piece.from_mm, offset));
      const double texels = turned / kTurn * geometry_.width;
      if (texels <= 0.5 * options_.texels_per_step) {
        const double middle = 0.5 * (piece.from_mm + piece.to_mm);
        add(line, middle, piece.from_mm, piece.to_mm, piece.length_mm(),
            profile_.at(std::hypot(middle, offset)));
        continue;
      }
      const int steps = static_cast<int>(std::ceil(texels / options_.texels_per_step));
      const double step = piece.length_mm() / steps;
      const double gauss = 0.5 * step / std::numbers::sqrt3;
      for (int i = 0; i < steps; ++i) {
        const double middle = piece.from_mm + (i + 0.5) * step;
        for (const int side : {-1, 1}) {
          const double along = middle + side * gauss, end = middle + side * 0.5 * step;
          add(line, along, std::min(middle, end), std::max(middle, end), 0.5 * step,
              profile_.at(std::hypot(along, offset)));
        }
      }
    }
  }

  const MapGeometry& geometry_;
  const SampleOptions& options_;
  RadialProfile profile_;
  std::vector<ColumnSample>& out_;
};

/// The stored projections on both sides of the view's angle. Seen from behind, a projection is mirrored.
void sample_projections(const RectifiedView& rectified, int column, const MapGeometry& geometry,
                        std::vector<ColumnSample>& out) {
  const double turn = std::atan2(rectified.forward.x, -rectified.forward.y) / std::numbers::pi;
  const double view = (turn < 0 ? turn + 2 : turn) * geometry.views;
  const double first = std::floor(view);
  const double u_mm = glm::dot(rectified.origin_mm(column) - geometry.centre_mm[0], rectified.right);
  if (std::abs(u_mm) > geometry.radius_mm()) return;
  const double s_mm = glm::dot(geometry.centre_mm[0] - rectified.centre_mm, rectified.forward);
  for (const int beside : {0, 1}) {
    const int index = static_cast<int>(first) + beside;
    const double weight = beside == 0 ? 1 - (view - first) : view - first;
    if (weight == 0) continue;
    const bool mirrored = index / geometry.views % 2 == 1;
    const double texel =
        std::clamp((mirrored ? -u_mm : u_mm) / geometry.row_spacing_mm + 0.5 * (geometry.width - 1), 0.0,
                   geometry.width - 1.0);
    const double left = std::min(std::floor(texel), std::max(0.0, geometry.width - 2.0));
    out.push_back({static_cast<float>(index % geometry.views * (geometry.width + 1) + left),
                   static_cast<float>(weight), static_cast<float>(texel - left), 0, static_cast<float>(s_mm),
                   static_cast<float>(s_mm - geometry.radius_mm()),
                   static_cast<float>(s_mm + geometry.radius_mm()), 0});
  }
}

}  // namespace

MapGeometry drawn_shells(const MapGeometry& geometry, const SampleOptions& options) {
  MapGeometry drawn = geometry;
  if (options.blends_layers(geometry)) drawn.radii_mm = halved_radii_mm(geometry.radii_mm);
  return drawn;
}

ColumnSamples column_samples(const RectifiedView& rectified, const MapGeometry& geometry,
                             const SampleOptions& options) {
  if (geometry.projection == Projection::sphere || geometry.centre_mm.size() > 1)
    throw InputError("column sampling needs a map with one straight axis");
  const bool is_rectangle = geometry.projection == Projection::rectangle;
  if (is_rectangle && (rectified.is_cone() || rectified.slope != 0))
    throw InputError("a rectangle map can show only untilted parallel views");
  ColumnSamples result;
  Sampler sampler(geometry, options, result.samples);
  for (int column = 0; column < rectified.columns; ++column) {
    const std::size_t first = result.samples.size();
    if (is_rectangle)
      sample_projections(rectified, column, geometry, result.samples);
    else
      sampler.sample(line_of(rectified, column, geometry.centre_mm[0]));
    const double run_mm = std::hypot(rectified.source_mm, rectified.column_x_mm(column));
    result.columns.push_back({static_cast<float>(first), static_cast<float>(result.samples.size() - first),
                              rectified.is_cone() ? static_cast<float>(1 / run_mm) : 0.0f, 0});
  }
  return result;
}

}  // namespace xraycast
