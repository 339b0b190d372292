#include "xraycast/requests/body_fit.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/casting/outline_bands.hpp"
#include "xraycast/kernels/params.h"
#include "xraycast/requests/band_partition.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

namespace xraycast {
namespace {

constexpr double kTurn = 2 * std::numbers::pi;
constexpr double kMargin_mm = 1;                  // outside of the skin
constexpr double kSmoothing = kTurn * 2.5 / 360;  // to each side
constexpr double kNarrowest = 0.05;               // of the largest R
constexpr double kSkinStep = 3;                   // voxels of a moved skin, of which one is given

/// How far the body reaches in the directions of a grid's columns and rows; 0 where there is none.
class Extents {
 public:
  Extents(int columns, int rows)
      : columns_(columns), rows_(rows), mm_(static_cast<std::size_t>(columns) * rows) {}

  /// What lies at a column and a row and `across` columns and `down` rows around.
  void add(double column, double row, double across, double down, double reach_mm) {
    const int first = static_cast<int>(std::floor(column - across)),
              last = std::min(static_cast<int>(std::ceil(column + across)), first + columns_ - 1);
    const int top = std::max(static_cast<int>(std::floor(row - down)), 0),
              bottom = std::min(static_cast<int>(std::ceil(row + down)), rows_ - 1);
    nearest_mm_ = std::min(nearest_mm_, static_cast<float>(reach_mm));
    for (int j = top; j <= bottom; ++j)
      for (int i = first; i <= last; ++i) {
        float& here = at(i, j);
        here = std::max(here, static_cast<float>(reach_mm));
      }
  }

  /// The largest around every place, then the mean of these with a Hann window as wide: smooth, and nowhere
  /// below what it was. `across` and `down` are in columns, for a row, and in rows.
  template <typename Across>
  void smooth(const Across& across, int down) {
    for (const bool averages : {false, true}) {
      filter_columns(averages, down);
      for (int j = 0; j < rows_; ++j) filter_row(averages, across(j), j);
    }
  }

  void limit(double least_mm, double most_mm) {
    for (float& mm : mm_) mm = std::clamp(mm, static_cast<float>(least_mm), static_cast<float>(most_mm));
  }

  /// These runs of rows, each as far as the farthest of its rows.
  Extents merged(std::span<const int> first_rows) const {
    Extents runs(columns_, static_cast<int>(first_rows.size()));
    runs.nearest_mm_ = nearest_mm_;
    for (int j = 0, run = 0; j < rows_; ++j) {
      if (run + 1 < runs.rows_ && j == first_rows[run + 1]) ++run;
      for (int i = 0; i < columns_; ++i)
        runs.at(i, run) = std::max(runs.at(i, run), mm_[static_cast<std::size_t>(j) * columns_ + i]);
    }
    return runs;
  }

  float largest() const { return std::ranges::max(mm_); }
  float nearest_mm() const { return nearest_mm_; }
  bool are_all_around() const { return std::ranges::min(mm_) > 0; }
  const std::vector<float>& mm() const { return mm_; }

 private:
  float& at(int column, int row) {
    return mm_[static_cast<std::size_t>(row) * columns_ + ((column % columns_) + columns_) % columns_];
  }

  /// Of the places up to `reach` to each side, which `place` gives.
  template <typename Place>
  static float filtered(bool averages, int reach, const Place& place) {
    double largest = 0, sum = 0, weights = 0;
    for (int i = -reach; i <= reach; ++i) {
      const double weight = 1 + std::cos(std::numbers::pi * i / (reach + 1)), value = place(i);
      largest = std::max(largest, value);
      sum += weight * value;
      weights += weight;
    }
    return static_cast<float>(averages ? sum / weights : largest);
  }

  void filter_row(bool averages, int reach, int row) {
    std::vector<float> line(static_cast<std::size_t>(columns_));
    for (int i = 0; i < columns_; ++i)
      line[i] = filtered(averages, std::min(reach, columns_ / 2), [&](int d) { return at(i + d, row); });
    for (int i = 0; i < columns_; ++i) at(i, row) = line[i];
  }

  void filter_columns(bool averages, int reach) {
    if (rows_ == 1) return;
    std::vector<float> line(static_cast<std::size_t>(rows_));
    for (int i = 0; i < columns_; ++i) {
      // Beyond a pole the rows go on half a turn around.
      const auto place = [&](int row) {
        return row < 0        ? at(i + columns_ / 2, -1 - row)
               : row >= rows_ ? at(i + columns_ / 2, 2 * rows_ - 1 - row)
                              : at(i, row);
      };
      for (int j = 0; j < rows_; ++j)
        line[j] = filtered(averages, std::min(reach, rows_ / 2), [&](int d) { return place(j + d); });
      for (int j = 0; j < rows_; ++j) at(i, j) = line[j];
    }
  }

  int columns_, rows_;
  float nearest_mm_ = std::numeric_limits<float>::infinity();
  std::vector<float> mm_;
};

int steps(double angle, double step) { return std::max(1, static_cast<int>(std::lround(angle / step))); }

double turn_of(const glm::dvec2& p) {
  const double turn = std::atan2(p.x, -p.y) / kTurn;
  return turn < 0 ? turn + 1 : turn;
}

/// Throws where a circle has no skin within and does not lie in the body, nor beside it.
void check_within(const Extents& extents, const MapGeometry& circles) {
  if (extents.nearest_mm() > circles.radius_mm() && !extents.are_all_around())
    throw InputError(
        "nothing of the body lies within {:g} mm of the centre; give another centre or a larger radius",
        circles.radius_mm());
}

/// About an axis, the body in runs of so many slices, the most superior first.
Extents around_axis(const MapGeometry& map, int slices, const OutlineFinder& finder,
                    std::span<const glm::dvec3> further_skin_mm) {
  const int runs = (map.height + slices - 1) / slices;
  Extents extents(map.width, runs);
  const double half_mm = 0.5 * glm::length(glm::dvec2(finder.skin_voxel_mm()));
  const auto row_of = [&](const glm::dvec3& voxel_mm) {
    const auto row = static_cast<int>(std::lround((map.top_mm - voxel_mm.z) / map.row_spacing_mm));
    return std::clamp(row, 0, map.height - 1);
  };
  const auto add_to = [&](int run, const glm::dvec2& centre_mm, const glm::dvec3& voxel_mm) {
    const glm::dvec2 p = glm::dvec2(voxel_mm) - centre_mm;
    const double r = glm::length(p), columns = map.width / kTurn * std::atan2(half_mm, r);
    extents.add(turn_of(p) * map.width - 0.5, run, columns, 0, r + half_mm + kMargin_mm);
  };
  const auto add = [&](const glm::dvec3& voxel_mm) {
    const int row = row_of(voxel_mm);
    add_to(runs - 1 - (map.height - 1 - row) / slices, map.centre_of_row_mm(row), voxel_mm);
  };
  // About a straight axis it makes no difference in which slice of a run a voxel lies.
  if (map.centre_mm.size() == 1)
    finder.visit_shadow_skins(slices, [&](int shadow, const glm::dvec3& voxel_mm) {
      add_to(runs - 1 - shadow, map.centre_mm[0], voxel_mm);
    });
  else
    finder.visit_skin(add);
  // Moved skin is given for some of the voxels alone: it counts also in the slices beside them.
  const double beside_mm = kSkinStep * finder.skin_voxel_mm().z;
  for (const glm::dvec3& voxel_mm : further_skin_mm)
    for (const double up_mm : {-beside_mm, 0.0, beside_mm}) add(voxel_mm + glm::dvec3(0, 0, up_mm));
  return extents;
}

void smooth_rows(Extents& extents, int width) {
  extents.smooth([&](int) { return steps(kSmoothing, kTurn / width); }, 0);
}

void limit_to(const MapGeometry& circles, Extents& extents) {
  extents.limit(kNarrowest * std::min<double>(extents.largest(), circles.radius_mm()), circles.radius_mm());
}

/// One outline for all rows.
std::vector<float> fit_one(const MapGeometry& circles, const OutlineFinder& finder,
                           std::span<const glm::dvec3> further_skin_mm) {
  Extents extents = around_axis(circles, circles.height, finder, further_skin_mm);
  check_within(extents, circles);
  smooth_rows(extents, circles.width);
  limit_to(circles, extents);
  return extents.mm();
}

/// One for each of a few bands of rows, whose borders are those of whole bricks of slices, as the casting
/// kernels take them at once.
std::vector<float> fit_bands(const MapGeometry& circles, const OutlineFinder& finder,
                             std::span<const glm::dvec3> further_skin_mm) {
  constexpr int kMostRuns = 64;
  const int bricks = (circles.height + XRC_BRICK_SLICES - 1) / XRC_BRICK_SLICES,
            slices = XRC_BRICK_SLICES * ((bricks + kMostRuns - 1) / kMostRuns);
  const Extents runs = around_axis(circles, slices, finder, further_skin_mm);
  check_within(runs.merged(std::array{0}), circles);
  const std::vector<int> first_runs = partition_into_bands(runs.mm(), circles.width, kMostOutlineBands);
  Extents bands = runs.merged(first_runs);
  smooth_rows(bands, circles.width);
  limit_to(circles, bands);
  if (first_runs.size() == 1) return bands.mm();

  const int all_runs = (circles.height + slices - 1) / slices;
  std::vector<float> rows_mm;
  rows_mm.reserve(static_cast<std::size_t>(circles.width) * circles.height);
  for (std::size_t band = 0; band < first_runs.size(); ++band) {
    const int end = band + 1 < first_runs.size() ? first_runs[band + 1] : all_runs;
    const auto first = bands.mm().begin() + static_cast<std::ptrdiff_t>(band) * circles.width;
    // The lowest run ends at the last row; the uppermost may be a part of one.
    const int last_row = circles.height - (all_runs - end) * slices;
    while (rows_mm.size() < static_cast<std::size_t>(last_row) * circles.width)
      rows_mm.insert(rows_mm.end(), first, first + circles.width);
  }
  return rows_mm;
}

/// About the centre of a sphere.
std::vector<float> fit_sphere(const MapGeometry& map, const OutlineFinder& finder,
                              std::span<const glm::dvec3> further_skin_mm) {
  Extents extents(map.width, map.height);
  const glm::dvec3 centre_mm(map.centre_mm[0], map.centre_z_mm);
  const double half_mm = 0.5 * glm::length(finder.skin_voxel_mm()), per_row = 0.5 * kTurn / map.height;
  const auto columns_in = [&](double angle, double row) {
    return angle / std::max(1e-6, std::sin(map.theta_rad(row))) * map.width / kTurn;
  };
  const auto add = [&](const glm::dvec3& voxel_mm) {
    const glm::dvec3 p = voxel_mm - centre_mm;
    const double r = glm::length(p), seen = std::atan2(half_mm, r);
    if (r == 0) return;
    const double row = std::acos(std::clamp(p.z / r, -1.0, 1.0)) / per_row - 0.5;
    extents.add(turn_of(glm::dvec2(p)) * map.width - 0.5, row,
                std::min(columns_in(seen, row), 1.0 * map.width), seen / per_row, r + half_mm + kMargin_mm);
  };
  finder.visit_skin(add);
  std::ranges::for_each(further_skin_mm, add);
  check_within(extents, map);
  extents.smooth(
      [&](int row) {
        return std::max(1, static_cast<int>(std::min(columns_in(kSmoothing, row), map.width / 4.0)));
      },
      steps(kSmoothing, per_row));
  limit_to(map, extents);
  return extents.mm();
}

}  // namespace

MapGeometry fit_to_body(const MapGeometry& circles, const OutlineFinder& finder,
                        std::span<const glm::dvec3> further_skin_mm) {
  return with_outline(circles, circles.ray_layout == RayLayout::sphere
                                   ? fit_sphere(circles, finder, further_skin_mm)
                               : circles.centre_mm.size() > 1 ? fit_one(circles, finder, further_skin_mm)
                                                              : fit_bands(circles, finder, further_skin_mm));
}

}  // namespace xraycast
