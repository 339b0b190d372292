#pragma once

#include "xraycast/catheter/hub.hpp"
#include "xraycast/catheter/introducer.hpp"
#include "xraycast/catheter/lumen_distance_field.hpp"
#include "xraycast/catheter/vessel_entry.hpp"
#include "xraycast/catheter/wall_contact.hpp"
#include "xraycast/geometry/nurbs_curve.hpp"
#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/mechanics/instrument_model.hpp"
#include "xraycast/mechanics/rod.hpp"

#include <glm/vec3.hpp>

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

namespace xraycast {

/// The node spacing at which the edges still follow the vessels' bends: one and a half times the radius of
/// the narrowest vessel that the instrument fits into, between 1.5 and 5 mm.
double node_spacing_mm(const VesselTree& tree, const InstrumentModel& instrument);

/// The location of a catheter's tip.
struct CatheterTip {
  glm::dvec3 position_mm{0, 0, 0};
  glm::dvec3 direction{0, 0, 1};  ///< unit
  int branch = 0;                 ///< of the tree
  double arc_length_mm = 0;       ///< from the branch's first point
};

/// A point of the rod in contact with a vessel's wall, and the wall's force on it.
struct CatheterContact {
  glm::dvec3 position_mm{0, 0, 0};
  glm::dvec3 force_N{0, 0, 0};  ///< friction included
};

/// A catheter or guide wire in a vessel tree, moved at its hub.
///
/// It enters at a vessel's end through an introducer, a straight sheath of 20 mm outside the tree; the rod is
/// simulated from the introducer's outer end to its tip and fed in and out there. At an insertion of 0 the
/// tip is at the vessel's end.
class Catheter {
 public:
  struct Options {
    double spacing_mm = 0;  ///< of the nodes, where the instrument is straight; 0: see node_spacing_mm
    double step_s = 1e-3;
    double wall_stiffness_N_mm2 = 0.5;  ///< see WallContact
    /// Of Newton's method in a step, and that times the nodes of all devices, at half a microsecond each, or
    /// one and a half where three devices overlap in a malformation: a step takes some 5 ms at most. While a
    /// tip snaps there would be some hundred: what is left is solved in the next steps. Not by the clock, so
    /// that runs can be repeated.
    int max_iterations = 50, max_node_iterations = 5'000;
  };

  // The hub moves no faster than a hand; a pose further ahead is approached at these speeds.
  static constexpr double kMaxSpeed_mm_s = 300, kMaxSpeed_rad_s = 30;

  /// Against a larger force an instrument buckles outside the introducer or slips through the fingers: the
  /// hub does not advance.
  static constexpr double kMaxPush_N = 3;

  /// Throws InputError when the instrument does not fit into the vessel at the entry (see check_fits).
  Catheter(const VesselTree& tree, const InstrumentModel& instrument, const VesselEnd& entry,
           const Options& options);
  Catheter(const VesselTree& tree, const InstrumentModel& instrument, const VesselEnd& entry)
      : Catheter(tree, instrument, entry, Options{}) {}

  /// One step in time towards a pose, whose insertion is clamped to 0 to max_insertion_mm().
  void step(const HubPose& target);

  double time_s() const { return static_cast<double>(steps_) * options_.step_s; }
  double step_s() const { return options_.step_s; }
  double max_insertion_mm() const;

  const HubPose& pose() const { return hub_.pose; }  ///< where the hub is
  bool is_held() const {
    return hub_.is_held;
  }  ///< the hub did not advance: the push force is kMaxPush_N already
  HubLoad load() const;
  CatheterTip tip() const;

  /// The rod's nodes from the introducer's outer end to the tip. Without allocation where `nodes_mm` has
  /// room.
  void copy_nodes(std::vector<glm::dvec3>& nodes_mm) const;
  void copy_contacts(std::vector<CatheterContact>& contacts) const;
  std::size_t max_nodes() const { return rod_.max_nodes(); }

  const Rod& rod() const { return rod_; }
  const WallContact& wall() const { return *wall_; }

  /// Elastic, kinetic, and in the walls.
  double energy_J() const;

 private:
  Options options_;
  Rod rod_;
  std::unique_ptr<WallContact> wall_;
  MovingHub hub_;
  long steps_ = 0;
};

/// The clamped cubic through nodes (four or more; see NurbsCurve::cubic), by progressive iteration (Lin, Bao
/// and Wang, Totally positive bases and progressive iteration approximation, 2005).
NurbsCurve curve_through(const std::vector<glm::dvec3>& nodes_mm);

}  // namespace xraycast
