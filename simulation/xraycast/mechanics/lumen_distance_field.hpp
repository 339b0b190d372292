#pragma once

#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/mechanics/vessel_entry.hpp"

#include <Eigen/Core>
#include <variant>
#include <vector>

namespace xraycast {

/// How far the wall of a branched, tapering tube is from a point within it: the union of the spheres around
/// every place of the centrelines, smooth along a branch and blended where branches meet. Vessel ends are
/// closed by half a sphere.
///
/// A point is looked for along the tree from where it was last, so that a query takes a fraction of a
/// microsecond, and vessels that pass through each other without a fork do not know of each other. Nor do
/// those that touch beyond their fork: from four radii away from it the clearance within another branch than
/// the last falls, and from six on there is none.
/// Immutable, so safe to share.
class LumenDistanceField {
 public:
  /// A place on the centrelines, from which a search starts.
  struct Place {
    int branch = 0, segment = 0;
  };

  /// `opening`, if there is one, goes on straight as a tube of `opening_length_mm` instead of being closed.
  explicit LumenDistanceField(const VesselTree& tree, const VesselEnd* opening = nullptr,
                              double opening_length_mm = 0);

  /// How one vessel's wall goes round: as a sphere does, but along the vessel, where the next spheres take
  /// over.
  struct Rounding {
    double distance_mm;     ///< from the sphere's centre
    Eigen::Vector3d aside;  ///< the centreline's derivative without its part along the gradient
    double change;  ///< of the clearance's growth along the centreline; below zero but at a bend's focus
    Eigen::Matrix3d curvature(const Eigen::Vector3d& gradient) const;
  };
  struct Sample {
    double clearance_mm = 0;            ///< to the wall; below zero outside
    Eigen::Vector3d gradient{0, 0, 0};  ///< of the clearance; of length 1 but where vessels meet
    double radius_mm = 0;               ///< of the vessel there
    Place place;
    double arc_length_mm = 0;  ///< on the place's branch, held to the tree's own
    /// What the curvature is formed from when it is asked for, or, where vessels meet, itself.
    std::variant<Rounding, Eigen::Matrix3d> wall;
    /// Minus the clearance's second derivative, per mm.
    Eigen::Matrix3d curvature() const;
  };
  Sample at(const Eigen::Vector3d& point_mm, const Place& from) const;

  /// The place whose wall is farthest around the point, wherever in the tree it is. Slow.
  Place locate(const Eigen::Vector3d& point_mm) const;

 private:
  struct Station {
    Eigen::Vector3d centre_mm, tangent;
    double radius_mm;
    double widening_mm;  ///< of the radius, to the next station; none at an end, which is round
    int folded = 0;      ///< so many stations to either side may be as near: a bend sharper than its radius
    int parts = 1;       ///< of the piece to the next station, in which to look for such places
  };
  /// The centreline and the radius from one station to the next: cubics with the stations' slopes.
  struct Piece {
    Eigen::Vector3d start_mm, slope, bend, skew;
    double start_radius_mm, start_widening, bulge, bow;
    Eigen::Vector3d centre_mm(double t) const { return start_mm + t * (slope + t * (bend + t * skew)); }
    Eigen::Vector3d along(double t) const { return slope + t * (2 * bend + 3 * t * skew); }
    Eigen::Vector3d turning(double t) const { return 2 * bend + 6 * t * skew; }
    double radius_mm(double t) const {
      return start_radius_mm + t * (start_widening + t * (bulge + t * bow));
    }
    double widening(double t) const { return start_widening + t * (2 * bulge + 3 * t * bow); }
    double widening_change(double t) const { return 2 * bulge + 6 * t * bow; }
  };
  /// Part of a piece within which the clearance first grows and then falls, and how fast at either end.
  struct Bracket {
    double low, high, before, behind;
  };
  struct Branch {
    std::vector<Station> stations;  ///< evenly spaced
    double step_mm = 0;
    double arc_offset_mm = 0, arc_length_mm = 0;  ///< where the tree's own part begins, and its length
    int start_joint = -1, end_joint = -1;
    Eigen::Vector3d lower_mm, upper_mm;  ///< of its stations
    double widest_mm = 0;
    std::vector<Piece> pieces;
    double steepest_mm = 0;  ///< that the radius less the distance may change from station to station
    double blend_mm = 0;     ///< how near another branch's clearance has to come to be blended with its own
  };
  /// Where branches meet.
  struct Joint {
    Eigen::Vector3d position_mm;
    double parting_mm = 0;  ///< within which its branches are one lumen wherever they overlap
    double reach_mm = 0;    ///< within which its branches look at each other
    std::vector<int> branches;
  };
  struct Hit {
    double radius_mm, arc_mm;
    Eigen::Vector3d gradient;
    Rounding rounding;
    Place place = {};
    double blend_mm = 0, wall_mm = 0;
    double value_mm() const { return radius_mm - rounding.distance_mm - wall_mm; }
  };
  static void mark_folds(Branch& branch);
  Hit hit(int branch, int from, const Eigen::Vector3d& point_mm) const;
  static Hit hit_end(const Branch& branch, bool is_last, const Eigen::Vector3d& point_mm);
  static Hit hit_piece(const Branch& branch, int index, const Bracket& bracket,
                       const Eigen::Vector3d& point_mm);
  static Piece piece(const Branch& branch, int index);
  static double growth(const Piece& piece, double t, const Eigen::Vector3d& point_mm);
  Sample sample(double clearance_mm, const Eigen::Vector3d& gradient, const Hit& hit) const;
  bool near_joint(const Branch& branch, const Eigen::Vector3d& point_mm) const;
  double highest_value_mm(const Branch& branch, const Eigen::Vector3d& point_mm) const;
  int guess(int branch, int joint, const Eigen::Vector3d& point_mm) const;

  std::vector<Branch> branches_;
  std::vector<Joint> joints_;
};

}  // namespace xraycast
