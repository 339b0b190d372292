#pragma once

#include "xraycast/haptics/haptic_device.hpp"
#include "xraycast/haptics/virtual_coupling.hpp"

#include <array>
#include <atomic>
#include <cstddef>
#include <span>
#include <vector>

namespace xraycast {

/// Leads the hubs of coaxial instruments by one haptic device, each through a virtual coupling, unless the
/// device is rigid.
///
/// A locked valve clamps them together, as a rotating haemostatic valve on the outer one's hub does: they
/// move as the hub that is held, whose hand feels the loads of all, and no further than all of them can.
/// Where one is at its end or out, or the loads' sum is a hand's greatest push, none goes on.
class HubCouplings {
 public:
  /// Of hubs that can be inserted so far. The device must outlive it.
  HubCouplings(HapticDevice& device, std::vector<double> max_insertions_mm);

  /// For any one thread; the next step applies it.
  void lock(bool is_locked) { wants_lock_.store(is_locked, std::memory_order_relaxed); }
  bool is_locked() const { return wants_lock_.load(std::memory_order_relaxed); }

  /// The pressure in the balloon of a hub's instrument, to which a step leads where the device is not rigid.
  /// For any one thread; another instrument begins at 0.
  void inflate(std::size_t hub, double bar) { wants_bar_[hub].store(bar, std::memory_order_relaxed); }
  double inflation_bar(std::size_t hub) const { return wants_bar_[hub].load(std::memory_order_relaxed); }

  /// The same of the sheath of a hub's stent: how far it is drawn back.
  void draw_sheath(std::size_t hub, double mm) {
    wants_release_mm_[hub].store(mm, std::memory_order_relaxed);
  }
  double sheath_mm(std::size_t hub) const { return wants_release_mm_[hub].load(std::memory_order_relaxed); }

  /// How many coils of a hub's wire are to be detached so far; see HubPose.
  void detach(std::size_t hub, double count) { wants_detached_[hub].store(count, std::memory_order_relaxed); }
  /// One more.
  void detach_next(std::size_t hub) { detach(hub, detachments(hub) + 1); }
  double detachments(std::size_t hub) const { return wants_detached_[hub].load(std::memory_order_relaxed); }

  /// Another instrument's hub, at a pose, instead of one; hand, pressure and sheath go on from there. For the
  /// thread that steps.
  void replace(std::size_t hub, const HubPose& at, double max_insertion_mm);

  /// A step from where the hubs are, with the instruments' loads on them. Returns the poses to move to, valid
  /// until the next step.
  std::span<const HubPose> step(std::span<const HubPose> hubs, std::span<const HubLoad> loads, double step_s);

 private:
  void move(std::span<const HubPose> hubs, std::span<const HubLoad> loads, double step_s);
  void move_valve(std::span<const HubPose> hubs);
  void release(std::size_t hub, const HubPose& at);
  void lead(std::size_t hub, const HubPose& at, const HubLoad& load, double step_s);
  double common_move_mm(double wanted_mm, std::span<const HubPose> hubs,
                        std::span<const HubLoad> loads) const;

  HapticDevice& device_;
  std::vector<double> max_insertions_mm_;
  CouplingSettings settings_;
  std::vector<VirtualCoupling> couplings_;
  std::vector<HubPose> targets_;
  std::atomic<bool> wants_lock_{false};
  std::array<std::atomic<double>, kMaxHubs> wants_bar_{}, wants_release_mm_{}, wants_detached_{};
  bool is_locked_ = false;
  std::size_t leader_ = 0;
};

}  // namespace xraycast
