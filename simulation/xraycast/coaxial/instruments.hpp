#pragma once

#include "xraycast/catheter/hub.hpp"
#include "xraycast/catheter/lumen_distance_field.hpp"
#include "xraycast/catheter/moving_body.hpp"
#include "xraycast/catheter/vessel_entry.hpp"
#include "xraycast/catheter/wall_contact.hpp"
#include "xraycast/coaxial/coaxial_rods.hpp"
#include "xraycast/coaxial/coil_pack.hpp"
#include "xraycast/coaxial/coil_pusher.hpp"
#include "xraycast/coaxial/treatment.hpp"
#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/mechanics/instrument_model.hpp"

#include <glm/vec3.hpp>

#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <vector>

namespace xraycast {

/// How far an instrument can be inserted: its length beyond the introducer, and that of a coil ahead of it.
double max_insertion_mm(const InstrumentModel& model);
std::vector<double> max_insertions_mm(const std::vector<InstrumentModel>& models);

/// The location of a catheter's tip.
struct InstrumentTip {
  glm::dvec3 position_mm{0, 0, 0};
  glm::dvec3 direction{0, 0, 1};  ///< unit
  int branch = 0;                 ///< of the tree
  double arc_length_mm = 0;       ///< from the branch's first point
  /// What its place shows: position_mm, but in a body that moves the scan's, where the tree lies.
  glm::dvec3 scan_mm{0, 0, 0};
};

/// A point of the rod in contact with a vessel's wall, and the wall's force on it.
struct InstrumentContact {
  glm::dvec3 position_mm{0, 0, 0};
  glm::dvec3 force_N{0, 0, 0};  ///< friction included
};

/// A catheter or guide wire in a vessel tree, or up to three one in the other, each moved at its own hub: a
/// wire in a catheter, or a wire in a microcatheter in a catheter.
///
/// All enter at a vessel's end through an introducer, a straight sheath of 20 mm outside the tree; the rods
/// are simulated from the introducer's outer end to their tips and fed in and out there. At an insertion of 0
/// a tip is at the vessel's end. The introducer holds the outermost instrument, which holds the others.
///
/// A wire that pushes a coil begins with the coil's far end: of its insertion, the coil's length is ahead of
/// its own tip, through the instruments around it. The coil comes out of the one that reaches furthest, and
/// only in the sac of an aneurysm: elsewhere the hub does not advance further. It is laid down there
/// (CoilPack), and detached once all of it is out. Drawn back to 0, the wire has the next one.
///
/// In a body that moves, instruments lie in the body at its instant, and the tree in the scan. The introducer
/// stays in the patient's frame where the entry is as they are put in.
class Instruments {
 public:
  struct Options {
    /// Of the nodes, where an instrument is straight; 0: one and a half times the radius of the narrowest
    /// vessel that it fits into, between 1.5 and 5 mm, at which the edges still follow the vessels' bends.
    double spacing_mm = 0;
    double step_s = 1e-3;
    double wall_stiffness_N_mm2 = 0.5;  ///< see WallContact
    /// Of Newton's method in a step, and that times the nodes of all instruments, so that its work is
    /// bounded: 50 iterations, or 5,000 divided by the nodes where there are more than 100. While a tip snaps
    /// there would be some hundred: what is left is solved in the next steps. Not by the clock, so that runs
    /// can be repeated; the time follows the processor, at some 0.5 to 1.5 us for a node's iteration. The
    /// slowest steps seen, of three instruments on busy machines, took 9 ms in a malformation and 5 to 12 ms
    /// in other trees.
    int max_iterations = 50, max_node_iterations = 5'000;
    /// How the body moves about instruments, and the phase of each mode as they are put in. None: it is
    /// still, as where no mode moves it.
    std::shared_ptr<const Motion> motion{};
    std::vector<double> phases{};
  };

  static constexpr std::size_t kMaxCount = 3;

  /// An instrument counts as drawn back up to this insertion. A catheter that is pushed over it drags it
  /// along, and the spring between the hand and its hub (see CouplingSettings) yields: by 0.55 mm to a J wire
  /// in a Cobra that was pushed into the thorax phantom.
  static constexpr double kDrawnBack_mm = 1;

  /// `instruments` from the outermost on. Throws InputError where one does not fit into the one around it,
  /// the outermost does not fit into the vessel at the entry, or there are more than kMaxCount.
  Instruments(const VesselTree& tree, const std::vector<InstrumentModel>& instruments, const VesselEnd& entry,
              const Options& options);
  Instruments(const VesselTree& tree, const std::vector<InstrumentModel>& instruments, const VesselEnd& entry)
      : Instruments(tree, instruments, entry, Options{}) {}

  /// One step in time towards a pose for each instrument, whose insertion is clamped to 0 to
  /// max_insertion_mm(), its pressure to what its balloon bears, and its release to its stent's length. A
  /// coil is detached as `detach` comes to the next whole number; see CoilPusher.
  void step(std::span<const HubPose> targets) { step(targets, phases()); }
  /// The same while the body moves to these phases, one a mode, where it has a motion.
  void step(std::span<const HubPose> targets, std::span<const double> phases);

  /// Of the motion's modes; none without a motion.
  std::span<const double> phases() const;
  std::size_t count() const { return rods_.count(); }
  double time_s() const { return static_cast<double>(steps_) * options_.step_s; }
  double step_s() const { return options_.step_s; }
  double max_insertion_mm(std::size_t instrument) const;

  /// What lies in the sacs of the tree's aneurysms, and how often that has changed.
  std::span<const CoilPack> coil_packs() const { return packs_; }
  long coil_changes() const { return coil_changes_; }
  /// Of a wire that pushes coils; one without any has none to push.
  const CoilPusher& coil_pusher(std::size_t instrument) const { return pushers_[instrument]; }
  /// The coil on it; none without one.
  std::optional<PushedCoil> pushed_coil(std::size_t instrument) const;

  const HubPose& pose(std::size_t instrument) const { return hubs_[instrument].pose; }  ///< where the hub is
  /// The hub did not advance: the push force is MovingHub::kMaxPush_N already. Without an instrument, any of
  /// them.
  bool is_held() const;
  bool is_held(std::size_t instrument) const { return hubs_[instrument].is_held; }
  HubLoad load(std::size_t instrument) const;
  InstrumentTip tip(std::size_t instrument) const;

  /// Of an instrument's balloon, which is filled only while all of it is beyond the introducer and the
  /// instruments around it: its pressure; and its radius, folded that of the instrument. 0 without a balloon.
  double balloon_bar(std::size_t instrument) const { return balloons_[instrument].bar; }
  double balloon_radius_mm(std::size_t instrument) const;

  /// The lengths of vessels that it lies in, as wide as it is; none while it is folded.
  std::span<const YieldingWalls::Opening> balloon_lengths(std::size_t instrument) const;

  /// The rings of a stent that are still on it: all, until its balloon was filled to the first pressure of
  /// its chart or more, and is folded again; or those in its sheath. A sheath frees a ring once it is drawn
  /// back from all of it, while the stent is wholly beyond the introducer and the instruments around it.
  int carried_rings(std::size_t instrument) const;

  /// What balloons did, and the walls, which yielded to them.
  const Treatments& treatments() const { return treatments_; }
  const VesselTree& tree() const { return tree_; }  ///< as it was at first
  /// The vessels as they are now, a tree with the same points, and how often they, or stents in them, have
  /// changed.
  VesselTree widened_tree() const { return treatments_.walls().widened(tree_); }
  long vessel_changes() const { return vessel_changes_; }
  const VesselEnd& entry() const { return end_; }  ///< of the tree

  /// All instruments within it are drawn back to 0 (see kDrawnBack_mm), so that contrast agent can be
  /// injected through it.
  bool has_free_lumen(std::size_t instrument) const;
  std::optional<std::size_t> free_lumen() const;  ///< the outermost instrument that has one

  /// Another model instead of an instrument that has been drawn back to 0 (see kDrawnBack_mm), at an
  /// insertion of 0. The others do not move. Throws InputError, and changes nothing, when it has not been
  /// drawn back, or when the instruments that there would be do not fit (see the constructor).
  void exchange(std::size_t instrument, const InstrumentModel& model);

  /// An instrument's nodes from the introducer's outer end to its tip, and what touches the vessel's wall.
  /// Without allocation where there is room.
  void copy_nodes(std::size_t instrument, std::vector<glm::dvec3>& nodes_mm) const;
  void copy_contacts(std::size_t instrument, std::vector<InstrumentContact>& contacts) const;

  const Rod& rod(std::size_t instrument) const { return rods_.rod(instrument); }
  const CoaxialRods& rods() const { return rods_; }
  const WallContact& wall(std::size_t instrument) const { return *walls_[instrument]; }

  /// Elastic, kinetic, in the lumens, and in the walls.
  double energy_J() const;
  /// What the moving wall, walls that yielded, and its balloon have done on an instrument since it was put
  /// in; see WallContact.
  double wall_work_J(std::size_t instrument) const { return wall(instrument).work_J(); }

 private:
  using Walls = std::vector<std::unique_ptr<WallContact>>;
  /// A balloon as it was worked on last.
  struct BalloonState {
    double bar = 0;
    bool carries_stent = false, opens_stent = false;
    Treatments::Place place{};
  };
  /// The stent of a sheath, on its way out.
  struct SheathState {
    int free_rings = 0;
    int branch = 0;
    double far_end_mm = 0, towards_hub = -1;  ///< see Treatments::Unsheathed
  };
  /// A place of an instrument's axis, by the vessels.
  struct AxisPlace {
    double from_tip_mm = 0;
    int branch = 0;
    double arc_mm = 0;
  };

  bool is_drawn_back(std::size_t instrument) const { return pose(instrument).insertion_mm <= kDrawnBack_mm; }
  Rod make_rod(const InstrumentModel& model) const;
  std::vector<Rod> make_rods(const std::vector<InstrumentModel>& instruments) const;
  std::unique_ptr<WallContact> make_wall(const CoaxialRods& rods, std::size_t instrument) const;
  static void settle(CoaxialRods& rods);
  std::size_t furthest_around(std::size_t instrument) const;
  std::optional<std::size_t> sac_at_tip(std::size_t instrument, double wire_mm) const;
  double largest_insertion_mm(std::size_t instrument) const;
  double rod_insertion_mm(std::size_t instrument) const;
  void push_coils();
  void push_coil(std::size_t instrument);
  bool is_out(std::size_t instrument, double from_tip_mm) const;
  std::vector<AxisPlace> axis_places(std::size_t instrument, double first_mm, double last_mm) const;
  Treatments::Place place_of_balloon(std::size_t instrument) const;
  void place_balloon(std::size_t instrument);
  std::optional<WallContact::Balloon> balloon_on_wall(std::size_t instrument) const;
  std::vector<Treatments::Filled> fill_balloons(bool& has_changed);
  std::vector<Treatments::Unsheathed> draw_sheaths();
  int uncovered_rings(std::size_t instrument) const;
  void place_stent(std::size_t instrument);
  void treat();

  VesselTree tree_;
  Options options_;
  std::shared_ptr<MovingBody> body_;  ///< none without a motion
  VesselEnd end_;                     ///< of the tree
  VesselEnd entry_;                   ///< that in the body
  MovingBody::Place entry_place_;     ///< what it showed as the introducer was put there
  Treatments treatments_;
  CoaxialRods rods_;
  Walls walls_;
  std::vector<MovingHub> hubs_;
  std::vector<BalloonState> balloons_;
  std::vector<SheathState> sheaths_;
  std::vector<CoilPack> packs_;  ///< of each sac
  std::vector<CoilPusher> pushers_;
  long coil_changes_ = 0;
  long vessel_changes_ = 0;
  long steps_ = 0;
};

/// Throws InputError unless there are one to Instruments::kMaxCount, the outermost first, and each
/// fits into those around it; and for coils without an instrument around them.
void check_instruments(const std::vector<InstrumentModel>& instruments);

}  // namespace xraycast
