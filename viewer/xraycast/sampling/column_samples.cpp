#include "xraycast/sampling/column_samples.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/parallel.hpp"
#include "xraycast/casting/outline_bands.hpp"
#include "xraycast/casting/outline_crossings.hpp"
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

/// What rays meet under the outline of a row.
struct RowShells {
  RowShells(const MapGeometry& geometry, int row, const SampleOptions& options)
      : profile(geometry.radii_mm, options.reconstruction), knots_mm(profile.knots_mm()) {
    if (geometry.has_outline()) outline.emplace(geometry, row);
    const double scale = options.wall_radius_mm.value_or(geometry.radius_mm()) / geometry.radius_mm();
    for (std::size_t k = 1; k < geometry.radii_mm.size(); ++k)
      walls_mm.push_back(scale * geometry.radii_mm[k]);
  }

  RadialProfile profile;
  std::vector<double> knots_mm, walls_mm;
  std::optional<OutlineCrossings> outline;
};

class Sampler {
 public:
  Sampler(const MapGeometry& geometry, const RowShells& shells, const SampleOptions& options,
          std::vector<ColumnSample>& out)
      : geometry_(geometry), shells_(shells), options_(options), out_(out) {}

  void sample(const Line& line) {
    const bool has_walls = options_.compositing == Compositing::wall;
    if (shells_.outline)
      has_walls ? sample_outlined_walls(line) : sample_outlined_path(line);
    else
      has_walls ? sample_walls(line) : sample_path(line);
  }

 private:
  /// A column of the map, beyond the first or last one by whole turns, and a radius as its shells have it.
  struct Place {
    double column, radius_mm;
  };

  /// Under circles.
  Place place_of(const Line& line, double along_mm) const {
    const glm::dvec2 p = line.at(along_mm);
    return {std::atan2(p.x, -p.y) / kTurn * geometry_.width - 0.5, glm::length(p)};
  }

  /// Under an outline.
  static Place place_of(const OutlineCrossings::Line& across, double along_mm) {
    const double column = across.column(along_mm);
    return {column, across.shell_radius_mm(along_mm, column)};
  }

  /// A sample at `along_mm` that integrates the interval [from_mm, to_mm] of the line.
  void add(const Line& line, double along_mm, double from_mm, double to_mm, double weight, double column,
           RadialProfile::LayerPosition position) {
    column -= geometry_.width * std::floor(column / geometry_.width);
    const double first = std::min(std::floor(column), geometry_.width - 1.0);
    out_.push_back({static_cast<float>(position.layer * (geometry_.width + 1) + first),
                    static_cast<float>(weight), static_cast<float>(column - first),
                    static_cast<float>(position.fraction), static_cast<float>(line.foot_s_mm + along_mm),
                    static_cast<float>(line.foot_s_mm + from_mm), static_cast<float>(line.foot_s_mm + to_mm),
                    static_cast<float>(position.layer)});
  }

  void sample_walls(const Line& line) {
    for (const int side : {-1, 1})
      for (int k = 0; k < geometry_.layers(); ++k) {
        const int layer = side < 0 ? geometry_.layers() - 1 - k : k;
        const double radius = shells_.walls_mm[layer], offset = line.offset_mm();
        if (radius <= offset) continue;
        const double along = side * std::sqrt((radius - offset) * (radius + offset));
        add(line, along, along, along, 1, place_of(line, along).column, {layer, 0});
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
    const auto field = within_field(line);
    for (const ShellPiece& piece : shell_pieces(shells_.knots_mm, line.offset_mm()))
      sample_piece(line, piece.from_mm, piece.to_mm, field,
                   [&](double along_mm) { return place_of(line, along_mm); });
  }

  /// What lies between two knots and in the scan's field. `place_at` gives the Place of one on the line.
  template <typename PlaceAt>
  void sample_piece(const Line& line, double from_mm, double to_mm, const std::pair<double, double>& field,
                    const PlaceAt& place_at) {
    from_mm = std::max(from_mm, field.first);
    to_mm = std::min(to_mm, field.second);
    if (from_mm >= to_mm) return;
    const double offset = line.offset_mm();
    const double turned = std::abs(std::atan2(to_mm, offset) - std::atan2(from_mm, offset));
    const double texels = turned / kTurn * geometry_.width;
    if (texels <= 0.5 * options_.texels_per_step) {
      const double middle = 0.5 * (from_mm + to_mm);
      const Place place = place_at(middle);
      return add(line, middle, from_mm, to_mm, to_mm - from_mm, place.column,
                 shells_.profile.at(place.radius_mm));
    }
    const int steps = static_cast<int>(std::ceil(texels / options_.texels_per_step));
    const double step = (to_mm - from_mm) / steps;
    const double gauss = 0.5 * step / std::numbers::sqrt3;
    for (int i = 0; i < steps; ++i) {
      const double middle = from_mm + (i + 0.5) * step;
      for (const int side : {-1, 1}) {
        const double along = middle + side * gauss, end = middle + side * 0.5 * step;
        const Place place = place_at(along);
        add(line, along, std::min(middle, end), std::max(middle, end), 0.5 * step, place.column,
            shells_.profile.at(place.radius_mm));
      }
    }
  }

  void sample_outlined_path(const Line& line) {
    const OutlineCrossings::Line across(*shells_.outline, line.foot_mm, line.direction);
    const auto field = within_field(line);
    const auto place_at = [&](double along_mm) { return place_of(across, along_mm); };
    const auto crossings = shells_.outline->crossings(across, shells_.knots_mm);
    for (std::size_t i = 0; i + 1 < crossings.size(); ++i) {
      const double from_mm = crossings[i].along_mm, to_mm = crossings[i + 1].along_mm;
      const double radius_mm = across.shell_radius_mm(0.5 * (from_mm + to_mm));
      if (radius_mm > shells_.knots_mm.front() && radius_mm < shells_.knots_mm.back())
        sample_piece(line, from_mm, to_mm, field, place_at);
    }
  }

  void sample_outlined_walls(const Line& line) {
    const OutlineCrossings::Line across(*shells_.outline, line.foot_mm, line.direction);
    for (const auto& [along_mm, wall] : shells_.outline->crossings(across, shells_.walls_mm))
      add(line, along_mm, along_mm, along_mm, 1, across.column(along_mm), {wall, 0});
  }

  const MapGeometry& geometry_;
  const RowShells& shells_;
  const SampleOptions& options_;
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
    const int layer = index % geometry.views;
    out.push_back({static_cast<float>(layer * (geometry.width + 1) + left), static_cast<float>(weight),
                   static_cast<float>(texel - left), 0, static_cast<float>(s_mm),
                   static_cast<float>(s_mm - geometry.radius_mm()),
                   static_cast<float>(s_mm + geometry.radius_mm()), static_cast<float>(layer)});
  }
}

bool are_columns(const MapGeometry& geometry, const std::vector<OutlineBand>& bands) {
  return geometry.ray_layout != RayLayout::sphere && geometry.centre_mm.size() == 1 &&
         bands.size() <= kMostOutlineBands;
}

}  // namespace

bool has_columns(const MapGeometry& geometry) { return are_columns(geometry, outline_bands(geometry)); }

MapGeometry drawn_shells(const MapGeometry& geometry, const SampleOptions& options) {
  MapGeometry drawn = geometry;
  if (options.blends_layers(geometry)) drawn.radii_mm = halved_radii_mm(geometry.radii_mm);
  return drawn;
}

ColumnSamples column_samples(const RectifiedView& rectified, const MapGeometry& geometry,
                             const SampleOptions& options) {
  const std::vector<OutlineBand> bands = outline_bands(geometry);
  if (!are_columns(geometry, bands))
    throw InputError("column sampling needs a map with one straight axis and at most {} outlines",
                     kMostOutlineBands);
  const bool is_rectangle = geometry.ray_layout == RayLayout::rectangle;
  if (is_rectangle && (rectified.is_cone() || rectified.slope != 0))
    throw InputError("a rectangle map can show only untilted parallel views");
  // Blocks of columns of each band, apart and then one behind the other.
  constexpr int kBlock = 64;
  std::vector<RowShells> shells;
  for (const OutlineBand& band : bands) shells.emplace_back(geometry, band.first_row, options);
  const int blocks = (rectified.columns + kBlock - 1) / kBlock;
  std::vector<ColumnSamples> parts(bands.size() * static_cast<std::size_t>(blocks));
  parallel_for(std::ssize(parts), [&](std::int64_t part) {
    const int first = static_cast<int>(part % blocks) * kBlock;
    auto& [columns, samples] = parts[static_cast<std::size_t>(part)];
    Sampler sampler(geometry, shells[static_cast<std::size_t>(part / blocks)], options, samples);
    for (int column = first; column < std::min(first + kBlock, rectified.columns); ++column) {
      const std::size_t before = samples.size();
      if (is_rectangle)
        sample_projections(rectified, column, geometry, samples);
      else
        sampler.sample(line_of(rectified, column, geometry.centre_mm[0]));
      const double run_mm = std::hypot(rectified.source_mm, rectified.column_x_mm(column));
      columns.push_back({static_cast<float>(before), static_cast<float>(samples.size() - before),
                         rectified.is_cone() ? static_cast<float>(1 / run_mm) : 0.0f, 0});
    }
  });
  constexpr std::size_t kMostSamples = 1 << 24;  // whole numbers of 32-bit floats
  std::size_t all = 0;
  for (const ColumnSamples& part : parts) all += part.samples.size();
  if (all > kMostSamples)
    throw InputError(
        "the picture takes {} samples of the map, but at most {} can be drawn; draw a smaller one, or cast "
        "fewer layers",
        all, kMostSamples);
  ColumnSamples result;
  for (ColumnSamples& part : parts) {
    const auto before = static_cast<float>(result.samples.size());
    for (ColumnSamples::Column& column : part.columns) column.first += before;
    result.columns.insert(result.columns.end(), part.columns.begin(), part.columns.end());
    result.samples.insert(result.samples.end(), part.samples.begin(), part.samples.end());
  }
  return result;
}

}  // namespace xraycast
