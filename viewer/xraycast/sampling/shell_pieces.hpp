#pragma once

#include <span>
#include <vector>

namespace xraycast {

/// The part of a straight line that lies within one shell, on one side of the axis.
struct ShellPiece {
  int shell;              ///< between radii[shell] and radii[shell + 1]
  double from_mm, to_mm;  ///< along the line, 0 where it is nearest to the axis; from < to
  double length_mm() const { return to_mm - from_mm; }
};

/// The intersections of a line with concentric shells, in order along the line: the far ones from the
/// outermost shell inwards, then the near ones outwards, each beginning where the one before it ends (but for
/// a hole within the first radius). `offset_mm` is the line's distance from the axis. Shells that it misses
/// or only touches have no piece.
///
/// A line out of the plane of the circles crosses cylinders like its projection into that plane; its lengths
/// are longer by the secant of its elevation.
std::vector<ShellPiece> shell_pieces(std::span<const double> radii_mm, double offset_mm);

}  // namespace xraycast
