#pragma once

#include "xraycast/casting/map_geometry.hpp"

#include <array>
#include <span>
#include <vector>

namespace xraycast {

/// The edges of all shells' halves: 2 K + 1 radii of K + 1 edges.
std::vector<double> halved_radii_mm(std::span<const double> radii_mm);

/// Halves every shell of a map, which doubles the number of knots between which mu is interpolated linearly.
/// The difference between the optical depths of a shell's halves follows from mu at its edges, the mean of
/// two estimates from the four shells around an edge: the slope there of a polynomial through the running sum
/// of optical depth, which is best where mu is smooth, and Akima's (A new method of interpolation and smooth
/// curve fitting, J. ACM 17:589, 1970), which does not overshoot at jumps. On a chest and a head of 32 layers
/// it gains 0.7 and 0.8 dB over linear shells alone.
class ShellHalves {
 public:
  /// K + 1 ascending edges, K at least 2.
  explicit ShellHalves(std::span<const double> radii_mm);

  /// For texels whose rays end at these radii (MapGeometry::reach_mm), beyond which there is nothing.
  class Split {
   public:
    /// Splits the optical depths of shells, K x texels, into those of their halves: half k of texel i is at
    /// k * stride + i. The two halves of a shell sum up to it.
    void halve(std::span<const float> shells, std::span<float> halves, std::size_t stride) const;

   private:
    friend class ShellHalves;
    std::size_t layers_ = 0, texels_ = 0;
    /// Layers x texels: 1 / length of the ray within a shell, or 0; the lengths within its halves; and what
    /// the outer half gains where mu is higher by 1 at the outer edge than at the inner one.
    std::vector<float> per_mm_, inner_mm_, outer_mm_, gain_mm_;
    std::vector<std::array<float, 4>> smooth_;  ///< an edge's estimate from the shells around it
  };
  Split split(std::span<const double> reaches_mm) const;

 private:
  std::vector<double> edges_mm_;
  std::vector<std::array<float, 4>> smooth_;
};

}  // namespace xraycast
