#pragma once

#include "xraycast/sampling/radial_profile.hpp"
#include "xraycast/sampling/rectified_view.hpp"

#include <cstdint>
#include <optional>
#include <vector>

namespace xraycast {

/// How the shells of a body map add up to a picture.
enum class Compositing {
  wall,  ///< the paper: every shell is a thin wall, which adds its texel where the ray crosses it
  path,  ///< every shell adds mu times the ray's length within it
};

/// One sample of the map by a column's rays, interpolated between two texel columns and two layers. In the
/// layout that the shaders read.
struct ColumnSample {
  float texel;            ///< layer * (map width + 1) + column of the first texel; a whole number below 2^24
  float weight;           ///< of the quadrature: mm of s (path), or 1 (wall)
  float column_fraction;  ///< of the next texel column
  float layer_fraction;   ///< of the next layer
  float s_mm;             ///< its place along the ray: see RectifiedView
  float from_mm, to_mm;   ///< the interval of s that it integrates; empty for a wall
  float layer;            ///< of the first texel
};
static_assert(sizeof(ColumnSample) == 32);

/// The samples of all columns of a rectified picture, for each band of the map's rows that share an outline
/// (outline_bands). A band's samples hold for its own rows alone.
struct ColumnSamples {
  /// Of a column in a band: its first sample, their number, and 1 / the horizontal distance from a cone's
  /// source to the plane, or 0.
  struct Column {
    float first, count, per_run_mm, unused;
  };
  static_assert(sizeof(Column) == 16);

  std::vector<Column> columns;        ///< those of one band behind those of the other
  std::vector<ColumnSample> samples;  ///< of a column in depth order, the farthest first
};

/// How rays sample a map's shells.
struct SampleOptions {
  Compositing compositing = Compositing::path;
  Reconstruction reconstruction = Reconstruction::linear;
  std::optional<double> wall_radius_mm{};  ///< wall: radius of the outermost wall, the others in proportion
  double texels_per_step = 3;              ///< path: texel columns spanned by a two-point quadrature, at most

  /// Whether samples are interpolated between layers; otherwise every layer_fraction is 0.
  bool blends_layers(const MapGeometry& geometry) const {
    return compositing == Compositing::path && reconstruction == Reconstruction::linear &&
           geometry.ray_layout != RayLayout::rectangle && geometry.layers() > 1;
  }
  bool operator==(const SampleOptions&) const = default;
};

/// The shells that are drawn of a map: its own, or their halves where layers are blended (ShellHalves).
MapGeometry drawn_shells(const MapGeometry& geometry, const SampleOptions& options);

/// Whether a map's rays can be sampled by columns: about one straight axis, and under one outline for all
/// rows or for each of a few bands of rows (kMostOutlineBands).
bool has_columns(const MapGeometry& geometry);

/// Samples a map along every column's rays: the optical depth of a picture is the sum over a column's samples
/// of weight times the interpolated map, at the heights that the rays have there.
///
/// path: between the radii at which the slope of mu changes, two-point Gauss-Legendre quadrature on steps
/// that span a few texel columns at most, and one point if the whole interval spans half of that; a column's
/// weights add up to the horizontal length of its rays within the map and the field of its scan. wall: one
/// sample at every crossing of a wall, far and near. Rectangle maps: the two stored projections beside the
/// view, interpolated linearly; they have no depth, and represent the whole chord.
///
/// `geometry` is of the drawn shells. Throws InputError for a map without columns, and a rectangle map under
/// a cone or tilt.
ColumnSamples column_samples(const RectifiedView& rectified, const MapGeometry& geometry,
                             const SampleOptions& options);

}  // namespace xraycast
