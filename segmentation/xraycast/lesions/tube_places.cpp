#include "xraycast/lesions/tube_places.hpp"

#include <glm/common.hpp>

#include <cmath>

namespace xraycast {
namespace {

std::vector<SegmentIndex::Segment> pieces_of(const VesselTree& tree, const std::vector<bool>& counts) {
  std::vector<SegmentIndex::Segment> pieces;
  for (std::size_t b = 0; b < tree.branches().size(); ++b) {
    if (!counts.empty() && !counts[b]) continue;
    const std::vector<VesselPoint>& points = tree.branches()[b].points;
    for (std::size_t k = 0; k + 1 < points.size(); ++k)
      pieces.push_back({points[k].position_mm, points[k + 1].position_mm, points[k].radius_mm,
                        points[k + 1].radius_mm, static_cast<int>(b), static_cast<int>(k)});
  }
  return pieces;
}

TubePlace place_of(const SegmentIndex::Nearest& found) {
  const SegmentIndex::Segment& piece = found.segment;
  return {.branch = piece.branch,
          .point = piece.point,
          .fraction = found.fraction,
          .centre_mm = glm::mix(piece.start_mm, piece.end_mm, found.fraction),
          .radius_mm = found.radius_mm(),
          .out_mm = found.out_mm()};
}

}  // namespace

double TubePlace::arc_length_mm(const VesselTree& tree) const {
  const std::vector<double>& along_mm = tree.branches()[static_cast<std::size_t>(branch)].arc_length_mm;
  const auto at = static_cast<std::size_t>(point);
  return std::lerp(along_mm[at], along_mm[at + 1], fraction);
}

TubePlaces::TubePlaces(const VesselTree& tree, const std::vector<bool>& counts)
    : pieces_(pieces_of(tree, counts)) {}

TubePlace TubePlaces::deepest(const glm::dvec3& point_mm) const {
  return place_of(pieces_.deepest(point_mm));
}

}  // namespace xraycast
