#pragma once

#include "xraycast/catheter/catheter.hpp"
#include "xraycast/coaxial/coaxial_rods.hpp"

#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <vector>

namespace xraycast {

/// Catheters and guide wires one in the other, in a vessel tree, each moved at its own hub: a wire in a
/// catheter, or a wire in a microcatheter in a catheter. One device alone moves as a Catheter does, bit for
/// bit.
///
/// All enter through the same introducer, and all insertions are counted from there, as a Catheter's is. The
/// introducer holds the outermost device, which holds the others.
class CoaxialCatheters {
 public:
  static constexpr std::size_t kMaxDevices = 3;

  /// A device counts as drawn back up to this insertion. A catheter that is pushed over it drags it along,
  /// and the spring between the hand and its hub (see CouplingSettings) yields: by 0.55 mm to a J wire in a
  /// Cobra that was pushed into the thorax phantom.
  static constexpr double kDrawnBack_mm = 1;

  /// `instruments` from the outermost on. Throws InputError where one does not fit into the one around it,
  /// the outermost does not fit into the vessel at the entry, or there are more than kMaxDevices.
  CoaxialCatheters(const VesselTree& tree, const std::vector<InstrumentModel>& instruments,
                   const VesselEnd& entry, const Catheter::Options& options);
  CoaxialCatheters(const VesselTree& tree, const std::vector<InstrumentModel>& instruments,
                   const VesselEnd& entry)
      : CoaxialCatheters(tree, instruments, entry, Catheter::Options{}) {}

  /// One step in time towards a pose for each device.
  void step(std::span<const HubPose> targets);

  std::size_t count() const { return rods_.count(); }
  double time_s() const { return static_cast<double>(steps_) * options_.step_s; }
  double step_s() const { return options_.step_s; }
  double max_insertion_mm(std::size_t device) const;

  const HubPose& pose(std::size_t device) const { return hubs_[device].pose; }
  bool is_held() const;  ///< one of the hubs; see Catheter::is_held
  bool is_held(std::size_t device) const { return hubs_[device].is_held; }
  HubLoad load(std::size_t device) const;
  CatheterTip tip(std::size_t device) const;

  /// All devices within it are drawn back to 0 (see kDrawnBack_mm), so that contrast agent can be injected
  /// through it.
  bool has_free_lumen(std::size_t device) const;
  std::optional<std::size_t> free_lumen() const;  ///< the outermost device that has one

  /// Another instrument instead of a device that has been drawn back to 0 (see kDrawnBack_mm), at an
  /// insertion of 0. The others do not move. Throws InputError, and changes nothing, when it has not been
  /// drawn back, or when the instruments that there would be do not fit (see the constructor).
  void exchange(std::size_t device, const InstrumentModel& instrument);

  /// A device's nodes from the introducer's outer end to its tip, and what touches the vessel's wall.
  void copy_nodes(std::size_t device, std::vector<glm::dvec3>& nodes_mm) const;
  void copy_contacts(std::size_t device, std::vector<CatheterContact>& contacts) const;

  const Rod& rod(std::size_t device) const { return rods_.rod(device); }
  const CoaxialRods& rods() const { return rods_; }
  const WallContact& wall(std::size_t device) const { return *walls_[device]; }

  /// Elastic, kinetic, in the lumens, and in the walls.
  double energy_J() const;

 private:
  using Walls = std::vector<std::unique_ptr<WallContact>>;

  bool is_drawn_back(std::size_t device) const { return pose(device).insertion_mm <= kDrawnBack_mm; }
  Rod make_rod(const InstrumentModel& instrument) const;
  std::vector<Rod> make_rods(const std::vector<InstrumentModel>& instruments) const;
  std::unique_ptr<WallContact> make_wall(const CoaxialRods& rods, std::size_t device) const;
  static void settle(CoaxialRods& rods);

  VesselTree tree_;
  Catheter::Options options_;
  VesselEnd entry_;
  std::shared_ptr<const LumenDistanceField> field_;
  CoaxialRods rods_;
  Walls walls_;
  std::vector<MovingHub> hubs_;
  long steps_ = 0;
};

/// Throws InputError unless there are one to CoaxialCatheters::kMaxDevices, the outermost first, and each
/// fits into those around it.
void check_devices(const std::vector<InstrumentModel>& instruments);

}  // namespace xraycast
