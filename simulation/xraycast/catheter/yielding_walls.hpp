#pragma once

#include "xraycast/catheter/lumen_distance_field.hpp"
#include "xraycast/geometry/vessel_tree.hpp"

#include <memory>
#include <span>
#include <vector>

namespace xraycast {

/// The walls of a vessel tree, which yield to what is opened in them, such as a balloon, and keep most of it.
///
/// What fills a vessel is centred in it: along a length of its centreline the lumen becomes as wide as that,
/// as the union of both, and goes over into what lies beside it at a slope of kSlope. Opened further, a
/// wall is elastic up to a strain of kElasticStrain, and plastic beyond, as a perfectly plastic material is:
/// let go, it recoils by that strain of its widest diameter, but never to less than it had. Other lesions
/// recoil by 10 to 30 per cent; the strain is chosen so that a balloon of 6.0 mm leaves 5.9 mm.
class YieldingWalls {
 public:
  static constexpr double kElasticStrain = 1.0 / 60;
  static constexpr double kSlope = 0.7;  ///< of the radius, where the wall goes over into what lies beside it

  explicit YieldingWalls(std::shared_ptr<const LumenDistanceField> field);

  /// What opens a vessel between two places of its centreline.
  struct Opening {
    int branch = 0;
    double from_mm = 0, to_mm = 0;  ///< from the branch's first point
    double radius_mm = 0;
    bool goes_on_before = false, goes_on_behind = false;  ///< another opening follows at that end
  };

  /// The walls while these hold them open, and no others. False where no wall has moved.
  bool hold(std::span<const Opening> openings);

  const std::shared_ptr<const LumenDistanceField>& field() const { return field_; }

  /// A tree whose walls these are, as they are now: its points stay, its radii grow.
  VesselTree widened(const VesselTree& tree) const;

 private:
  /// Of a branch that something was opened in, at its stations.
  struct Yield {
    std::vector<double> at_first_mm, widest_mm;  ///< radii
  };
  double held_mm(int branch, int station, std::span<const Opening> openings) const;
  bool hold(int branch, std::span<const Opening> openings);

  std::shared_ptr<const LumenDistanceField> field_;
  std::vector<Yield> yields_;  ///< one a branch, empty where nothing was opened
};

}  // namespace xraycast
