#pragma once

#include "xraycast/catheter/vessel_entry.hpp"
#include "xraycast/geometry/vessel_tree.hpp"

#include <Eigen/Core>
#include <memory>
#include <span>
#include <variant>
#include <vector>

namespace xraycast {

/// The signed distance from a point to the wall of a branched, tapering tube: the union of the spheres around
/// all points of the centrelines, smooth along a branch and blended where branches meet. Vessel ends are
/// closed by half a sphere.
///
/// A query searches along the tree from where the previous one ended, so that it takes a fraction of a
/// microsecond. Vessels that intersect without a common bifurcation are independent; so are those that touch
/// beyond their bifurcation: from four radii away from it the clearance within another branch than the last
/// decreases, and from six on there is none. Immutable, so safe to share.
class LumenDistanceField {
 public:
  /// The place on the centrelines where a search starts.
  struct SearchHint {
    int branch = 0, segment = 0;
  };

  /// At `opening`, if given, the vessel continues straight as a tube of `opening_length_mm` instead of being
  /// closed.
  explicit LumenDistanceField(const VesselTree& tree, const VesselEnd* opening = nullptr,
                              double opening_length_mm = 0);

  /// The second derivative of one vessel's clearance, in the quantities that it is computed from: a sphere's,
  /// except along the vessel, where the next spheres take over.
  struct WallCurvature {
    double distance_mm;          ///< from the sphere's centre
    Eigen::Vector3d transverse;  ///< the centreline's derivative without its part along the gradient
    double slope_change;  ///< second derivative of the clearance along the centreline; below zero but at a
                          ///< bend's focus
    Eigen::Matrix3d matrix(const Eigen::Vector3d& gradient) const;
    /// That times a vector.
    Eigen::Vector3d times(const Eigen::Vector3d& gradient, const Eigen::Vector3d& vector) const;
  };
  struct Sample {
    double clearance_mm = 0;            ///< to the wall; below zero outside
    Eigen::Vector3d gradient{0, 0, 0};  ///< of the clearance; of length 1 except where vessels meet
    double radius_mm = 0;               ///< of the vessel there
    SearchHint hint;                    ///< for a query nearby; its branch is the vessel that the point is in
    double arc_length_mm = 0;           ///< on the hint's branch, clamped to the tree's own part of it
    /// Evaluated on demand or, where vessels meet, the matrix itself.
    std::variant<WallCurvature, Eigen::Matrix3d> wall;
    /// Minus the clearance's second derivative, per mm.
    Eigen::Matrix3d curvature() const;
  };
  Sample at(const Eigen::Vector3d& point_mm, const SearchHint& from) const;

  /// A point to sample at, and where its sample goes.
  struct Query {
    Eigen::Vector3d point_mm;
    SearchHint from;
    Sample* sample;
  };
  /// The same for many points, which takes less time for each: several are worked on at once.
  void sample(std::span<const Query> queries) const;

  /// The hint for a point without a previous one: the whole tree is searched for the sphere that reaches
  /// furthest beyond the point. Slow.
  SearchHint locate(const Eigen::Vector3d& point_mm) const;

  /// Where a branch's radii are kept: at even steps of half its narrowest radius, 0.5 to 1.5 mm.
  int branch_count() const { return static_cast<int>(branches_.size()); }
  double arc_length_mm(int branch) const { return branch_at(branch).arc_length_mm; }
  int station_count(int branch) const;
  double station_arc_mm(int branch,
                        int station) const;  ///< from the branch's first point; of an opening beyond
  double station_radius_mm(int branch, int station) const;

  /// The same vessels where one has other radii at its stations. Places on the centrelines keep their hints.
  LumenDistanceField with_radii(int branch, std::span<const double> radii_mm) const;

 private:
  struct Station {
    Eigen::Vector3d centre_mm, tangent;
    double radius_mm;
    double radius_slope_mm;  ///< change of the radius to the next station; zero at an end, which is round
    int fold_reach = 0;  ///< so many stations to either side may hold another local maximum of the clearance:
                         ///< the bend is sharper than its radius
    int parts = 1;       ///< of the piece to the next station, searched one by one for such maxima
  };
  /// The centreline and the radius from one station to the next: cubics in t, 0 to 1, with the stations'
  /// slopes.
  struct Piece {
    Eigen::Vector3d start_mm, linear, quadratic, cubic;
    double start_radius_mm, radius_linear, radius_quadratic, radius_cubic;
    Eigen::Vector3d centre_mm(double t) const {
      return start_mm + t * (linear + t * (quadratic + t * cubic));
    }
    Eigen::Vector3d derivative(double t) const { return linear + t * (2 * quadratic + 3 * t * cubic); }
    Eigen::Vector3d second_derivative(double t) const { return 2 * quadratic + 6 * t * cubic; }
    double radius_slope(double t) const {
      return radius_linear + t * (2 * radius_quadratic + 3 * t * radius_cubic);
    }
    double radius_slope_change(double t) const { return 2 * radius_quadratic + 6 * t * radius_cubic; }
  };
  /// Part of a piece within which the clearance first grows and then falls, and its slope at either end.
  struct Bracket {
    double low, high, slope_low, slope_high;
  };
  struct Branch {
    std::vector<Station> stations;  ///< evenly spaced
    double step_mm = 0;
    double arc_offset_mm = 0, arc_length_mm = 0;  ///< where the tree's own part begins, and its length
    int start_bifurcation = -1, end_bifurcation = -1;
    Eigen::Vector3d lower_mm, upper_mm;  ///< bounds of its stations
    double max_radius_mm = 0;
    std::vector<Piece> pieces;
    double max_change_mm = 0;  ///< of the radius less the distance, from station to station
    double blend_mm = 0;       ///< another branch's clearance is blended with its own within this
  };
  struct Bifurcation {
    Eigen::Vector3d position_mm;
    double merge_radius_mm = 0;   ///< within which its branches are one lumen wherever they overlap
    double search_radius_mm = 0;  ///< within which its branches interact
    std::vector<int> branches;
  };
  /// The sphere of one branch that reaches furthest beyond a point.
  struct Projection {
    double radius_mm, arc_mm;
    Eigen::Vector3d gradient;
    WallCurvature wall;
    SearchHint hint = {};
    double blend_mm = 0, separation_mm = 0;  ///< see Separation
    double clearance_mm() const { return radius_mm - wall.distance_mm - separation_mm; }
  };
  /// The reduction of the clearance in another branch beyond its bifurcation, with its derivatives.
  struct Separation {
    double distance_mm;
    Eigen::Vector3d gradient;
    Eigen::Matrix3d hessian;
  };
  struct Candidates;
  struct Group;
  /// Where the search along a branch ends: on a piece or, beyond all of them, at one of the branch's ends.
  struct Place {
    int piece = 0;
    bool is_first_end = false, is_last_end = false;
    Bracket bracket{};
    bool is_end() const { return is_first_end || is_last_end; }
  };

  static std::vector<VesselPoint> resampled(const VesselBranch& vessel);
  static Branch branch_of(const VesselBranch& vessel, const VesselEnd* opening, double opening_length_mm);
  static void take_radii(Branch& branch, std::span<const double> radii_mm);
  void add_bifurcation(std::vector<Branch>& branches, int parent, const std::vector<int>& children);
  const Branch& branch_at(int branch) const { return *branches_[static_cast<std::size_t>(branch)]; }
  static void add_pieces(Branch& branch);
  static Piece piece_from(const Branch& branch, std::size_t station);
  static void mark_folds(Branch& branch, std::size_t piece);

  static double clearance_slope(const Piece& piece, double t, const Eigen::Vector3d& point_mm);
  static double clearance_slope(const Branch& branch, int station, const Eigen::Vector3d& point_mm);
  static Place find_place(const Branch& branch, int from, const Eigen::Vector3d& point_mm);
  Projection project(int branch, int from, const Eigen::Vector3d& point_mm) const;
  void complete(int branch, const Place& place, const Eigen::Vector3d& point_mm, Projection& best) const;
  void sample_group(const Group& group) const;
  static void search_folds(const Branch& branch, int segment, const Eigen::Vector3d& point_mm,
                           Projection& best);
  static Projection project_onto_end(const Branch& branch, bool is_last, const Eigen::Vector3d& point_mm);
  static Projection project_onto_piece(const Branch& branch, int index, const Bracket& bracket,
                                       const Eigen::Vector3d& point_mm);
  template <typename Real>
  struct Pieces;
  template <typename Real>
  struct PieceProjections;
  bool near_bifurcation(const Branch& branch, const Eigen::Vector3d& point_mm) const;
  void add_neighbours(int branch, const Eigen::Vector3d& point_mm, Candidates& candidates) const;
  static void separate(const Bifurcation& bifurcation, const Eigen::Vector3d& point_mm,
                       Separation& separation);
  static double max_clearance_mm(const Branch& branch, const Eigen::Vector3d& point_mm);
  int start_station(int branch, int bifurcation, const Eigen::Vector3d& point_mm) const;
  Sample blended(const Candidates& candidates) const;
  Sample with_neighbours(const Projection& own, const Eigen::Vector3d& point_mm) const;
  Sample sample_of(double clearance_mm, const Eigen::Vector3d& gradient, const Projection& projection) const;

  std::vector<std::shared_ptr<const Branch>> branches_;  ///< shared by fields that differ in others
  std::vector<Bifurcation> bifurcations_;
};

}  // namespace xraycast
