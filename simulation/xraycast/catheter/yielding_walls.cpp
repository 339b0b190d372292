#include "xraycast/catheter/yielding_walls.hpp"

#include "xraycast/catheter/lumen_profile.hpp"

#include <algorithm>
#include <cmath>

namespace xraycast {

YieldingWalls::YieldingWalls(std::shared_ptr<const LumenDistanceField> field)
    : field_(std::move(field)), yields_(static_cast<std::size_t>(field_->branch_count())) {}

/// The widest that openings ask for; zero where they ask for nothing. They reach to the next station beyond
/// their ends, so that between stations, too, no place in an opening is narrower.
double YieldingWalls::held_mm(int branch, int station, std::span<const Opening> openings) const {
  const double arc_mm = field_->station_arc_mm(branch, station),
               step_mm = field_->station_arc_mm(branch, 1) - field_->station_arc_mm(branch, 0);
  double held_mm = 0;
  for (const Opening& opening : openings) {
    if (opening.branch != branch) continue;
    const double before_mm = opening.goes_on_before ? 0 : step_mm,
                 behind_mm = opening.goes_on_behind ? 0 : step_mm;
    const double beyond_mm =
        std::max({0.0, opening.from_mm - before_mm - arc_mm, arc_mm - opening.to_mm - behind_mm});
    held_mm = std::max(held_mm, opening.radius_mm - kSlope * beyond_mm);
  }
  return held_mm;
}

bool YieldingWalls::hold(std::span<const Opening> openings) {
  bool moves = false;
  for (int branch = 0; branch < field_->branch_count(); ++branch) moves = hold(branch, openings) || moves;
  return moves;
}

bool YieldingWalls::hold(int branch, std::span<const Opening> openings) {
  Yield& yield = yields_[static_cast<std::size_t>(branch)];
  const int stations = field_->station_count(branch);
  if (yield.widest_mm.empty()) {
    const auto is_here = [&](const Opening& opening) { return opening.branch == branch; };
    if (std::none_of(openings.begin(), openings.end(), is_here)) return false;
    for (int k = 0; k < stations; ++k) yield.at_first_mm.push_back(field_->station_radius_mm(branch, k));
    yield.widest_mm = yield.at_first_mm;
  }
  std::vector<double> radii_mm = yield.at_first_mm;
  bool moves = false;
  for (int k = 0; k < stations; ++k) {
    const auto at = static_cast<std::size_t>(k);
    const double open_mm = held_mm(branch, k, openings);
    yield.widest_mm[at] = std::max(yield.widest_mm[at], open_mm);
    radii_mm[at] = std::max({radii_mm[at], open_mm, (1 - kElasticStrain) * yield.widest_mm[at]});
    moves = moves || radii_mm[at] != field_->station_radius_mm(branch, k);
  }
  if (moves) field_ = std::make_shared<const LumenDistanceField>(field_->with_radii(branch, radii_mm));
  return moves;
}

VesselTree YieldingWalls::widened(const VesselTree& tree) const {
  std::vector<VesselBranch> branches = tree.branches();
  for (std::size_t b = 0; b < branches.size(); ++b) {
    if (yields_[b].widest_mm.empty()) continue;
    for (std::size_t k = 0; k < branches[b].points.size(); ++k) {
      double& of_point_mm = branches[b].points[k].radius_mm;
      of_point_mm =
          std::max(of_point_mm, radius_mm(*field_, static_cast<int>(b), branches[b].arc_length_mm[k]));
    }
  }
  return {std::move(branches), "the vessels"};
}

}  // namespace xraycast
