#include "xraycast/sampling/shell_pieces.hpp"

#include <algorithm>
#include <cmath>

namespace xraycast {

std::vector<ShellPiece> shell_pieces(std::span<const double> radii_mm, double offset_mm) {
  const double offset = std::abs(offset_mm);
  /// Half the chord within a circle; written as a product, which stays exact where the line grazes it.
  const auto half_chord_mm = [offset](double radius_mm) {
    return radius_mm > offset ? std::sqrt((radius_mm - offset) * (radius_mm + offset)) : 0.0;
  };
  std::vector<ShellPiece> near;
  for (std::size_t k = 0; k + 1 < radii_mm.size(); ++k) {
    const double from = half_chord_mm(radii_mm[k]), to = half_chord_mm(radii_mm[k + 1]);
    if (to > from) near.push_back({static_cast<int>(k), from, to});
  }
  std::vector<ShellPiece> pieces;
  for (auto piece = near.rbegin(); piece != near.rend(); ++piece)
    pieces.push_back({piece->shell, -piece->to_mm, -piece->from_mm});
  pieces.insert(pieces.end(), near.begin(), near.end());
  return pieces;
}

}  // namespace xraycast
