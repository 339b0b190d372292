#pragma once

#include <span>
#include <vector>

namespace xraycast {

/// Scattered radiation on a grid of square cells, as shares of the open field's primary quanta.
///
/// Every cell of the beam scatters in proportion to its primary radiation and to the water in its way, over a
/// Gaussian of 60 mm on the detector, so that the ratio of scatter to primary grows with thickness and with
/// the field: 3 without a grid in the middle of a field of 30 x 30 cm behind 20 cm of water, as J. T.
/// Bushberg et al., The essential physics of medical imaging, give for a trunk. After the kernels of L. A.
/// Love and R. A. Kruger, Scatter estimation for a digital radiographic system using convolution filtering,
/// Med. Phys. 14, 1987.
class Scatter {
 public:
  Scatter(int columns, int rows, double cell_mm);

  /// `primary`: of each cell, as a share of the open field, what the blades hold back included; `g_cm2`: the
  /// water in its way. Row by row. The result stays valid until the next call.
  std::span<const float> from(std::span<const float> primary, std::span<const float> g_cm2);

 private:
  int columns_, rows_;
  std::vector<float> weights_, sources_, spread_, result_;
};

}  // namespace xraycast
