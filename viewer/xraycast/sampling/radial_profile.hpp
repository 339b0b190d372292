#pragma once

#include <span>
#include <vector>

namespace xraycast {

/// The model of mu along a radius, of which a map holds only the shells' integrals.
enum class Reconstruction {
  linear,    ///< linear between the middles of the shells, with each shell's sum as the map has it
  constant,  ///< constant within each shell; its edges show as bands
};

/// Deconvolves the optical depths of the shells into mu (1/mm) in the middle of each, such that mu
/// interpolated linearly between the middles, and constant beyond the first and last, has the same integrals.
/// Otherwise interpolation would blur each shell into its neighbours: on a head with 16 layers that costs 3
/// dB.
///
/// A tridiagonal, diagonally dominant system for each map texel.
class RadialProfile {
 public:
  /// K + 1 ascending edges.
  RadialProfile(std::span<const double> radii_mm, Reconstruction reconstruction);

  int layers() const { return static_cast<int>(thickness_mm_.size()); }

  /// For texels whose rays end at these radii (MapGeometry::reach_mm), beyond which there is nothing: the
  /// shell in which a ray ends keeps its integral up to there. Farther out mu is extrapolated constantly, for
  /// lines that end elsewhere.
  class System {
   public:
    /// In place, for as many texels: layer k of texel i is at values[k * layer_stride + i].
    void solve(std::span<float> values, std::size_t layer_stride) const;

   private:
    friend class RadialProfile;
    std::size_t layers_ = 0, texels_ = 0;
    std::vector<float> per_mm_, below_, upper_, pivot_;  ///< layers x texels, factored (Thomas' algorithm)
  };
  System system(std::span<const double> reaches_mm) const;

  /// The radii at which the slope of mu changes: the inner edge, the middles, the outer edge; or all edges
  /// for constant shells.
  std::vector<double> knots_mm() const { return knots_mm_; }

  /// The layer to interpolate from at a radius within the edges, and the weight of the next one: 0 to 1, and
  /// always 0 where mu is constant in a shell. Where it is not, there is a next layer.
  struct LayerPosition {
    int layer;
    double fraction;
  };
  LayerPosition at(double radius_mm) const;

 private:
  /// The mean of mu over shell k up to where a ray ends, which is its sum * per_mm: `below` of the layer
  /// before, `above` of the next, and the rest its own.
  struct Row {
    double below = 0, above = 0, per_mm = 0;
  };
  Row row(std::size_t k, double reach_mm) const;

  std::vector<double> edges_mm_, middles_mm_, thickness_mm_, knots_mm_;
  Reconstruction reconstruction_;
};

}  // namespace xraycast
