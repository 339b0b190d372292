#pragma once

#include "xraycast/sampling/radial_profile.hpp"
#include "xraycast/sampling/rectified_view.hpp"

#include <cstdint>
#include <optional>
#include <vector>

namespace xraycast {

/// How a body map becomes a picture.
enum class Compositing {
  wall,  ///< the paper: every shell is a thin wall, which counts with its texel where the ray meets it
  path,  ///< every shell counts with the length that the ray takes through it
};

/// One place where a column's rays look the map up: between two texel columns and between two layers. As the
/// shaders read it.
struct ColumnSample {
  float texel;           ///< layer * (map width + 1) + column of the first texel; a whole number below 2^24
  float weight;          ///< mm of the ray's shadow that the sample stands for (path), or 1 (wall)
  float column_share;    ///< of the next texel column
  float layer_share;     ///< of the next layer
  float s_mm;            ///< where: see RectifiedView
  float from_mm, to_mm;  ///< what of s the sample stands for; nothing for a wall
  float unused;
};
static_assert(sizeof(ColumnSample) == 32);

/// The samples of all columns of an upright picture.
struct ColumnSamples {
  /// For each column: its first sample, how many there are, 1 / the run from a cone's source to the plane (or
  /// 0), and nothing.
  struct Column {
    float first, count, per_run_mm, unused;
  };
  static_assert(sizeof(Column) == 16);

  std::vector<Column> columns;
  std::vector<ColumnSample> samples;  ///< of a column from far to near
};

/// What to draw of a map's shells, and how finely.
struct SampleOptions {
  Compositing compositing = Compositing::path;
  Reconstruction reconstruction = Reconstruction::linear;
  std::optional<double> wall_radius_mm{};  ///< wall: the outermost wall stands here, the others in proportion
  double texels_per_step = 3;              ///< path: a quadrature of two points spans no more texel columns

  /// Whether samples lie between layers; if not, all their layer_share are 0.
  bool blends_layers(const MapGeometry& geometry) const {
    return compositing == Compositing::path && reconstruction == Reconstruction::linear &&
           geometry.projection != Projection::rectangle && geometry.layers() > 1;
  }
  bool operator==(const SampleOptions&) const = default;
};

/// The shells that are drawn of a map: its own, or their halves where they are blended (ShellHalves).
MapGeometry drawn_shells(const MapGeometry& geometry, const SampleOptions& options);

/// Follows every column's rays through a map: a picture is the sum over a column's samples of weight times
/// the map between its texels, at the heights that the rays have there.
///
/// path: between the places where mu bends along the radius, Gauss-Legendre quadrature of two points on steps
/// that turn by a few texels at most, and of one where the whole way turns by half of that; the sum of a
/// column's weights is the length of its rays' shadow within the map and the field of its scan. wall: each
/// wall where the ray crosses it, far and near. Rectangle maps: the two stored pictures beside the view, in
/// proportion; they have no depth, and stand for the whole chord.
///
/// `geometry` is of the drawn shells. Throws InputError for a map whose axis is bent, a sphere, and a
/// rectangle map under a cone or tilt.
ColumnSamples column_samples(const RectifiedView& upright, const MapGeometry& geometry,
                             const SampleOptions& options);

}  // namespace xraycast
