#include "xraycast/haptics/hub_couplings.hpp"

#include "xraycast/catheter/hub.hpp"

#include <algorithm>
#include <utility>

namespace xraycast {

HubCouplings::HubCouplings(HapticDevice& device, std::vector<double> max_insertions_mm)
    : device_(device),
      max_insertions_mm_(std::move(max_insertions_mm)),
      settings_(device.renders_loads() ? CouplingSettings{} : CouplingSettings::without_feedback()),
      couplings_(max_insertions_mm_.size(), VirtualCoupling({}, settings_)),
      targets_(max_insertions_mm_.size()) {}

void HubCouplings::replace(std::size_t hub, const HubPose& at, double max_insertion_mm) {
  max_insertions_mm_[hub] = max_insertion_mm;
  inflate(hub, at.inflation_bar);
  draw_sheath(hub, at.release_mm);
  detach(hub, at.detach);
  release(hub, at);
}

std::span<const HubPose> HubCouplings::step(std::span<const HubPose> hubs, std::span<const HubLoad> loads,
                                            double step_s) {
  if (device_.is_rigid()) {
    for (std::size_t hub = 0; hub < hubs.size(); ++hub) targets_[hub] = device_.pose(hub).pose;
    return targets_;
  }
  move(hubs, loads, step_s);
  for (std::size_t hub = 0; hub < hubs.size(); ++hub) {
    targets_[hub].inflation_bar = inflation_bar(hub);
    targets_[hub].release_mm = sheath_mm(hub);
    targets_[hub].detach = detachments(hub);
  }
  return targets_;
}

void HubCouplings::move(std::span<const HubPose> hubs, std::span<const HubLoad> loads, double step_s) {
  move_valve(hubs);
  if (!is_locked_) {
    for (std::size_t hub = 0; hub < hubs.size(); ++hub) lead(hub, hubs[hub], loads[hub], step_s);
    return;
  }
  HubLoad sum;
  for (const HubLoad& load : loads) sum.force_N += load.force_N, sum.torque_Nm += load.torque_Nm;
  lead(leader_, hubs[leader_], sum, step_s);
  const HubPose &from = hubs[leader_], to = targets_[leader_];
  const double move_mm = common_move_mm(to.insertion_mm - from.insertion_mm, hubs, loads);
  for (std::size_t hub = 0; hub < hubs.size(); ++hub) {
    targets_[hub] = {hubs[hub].insertion_mm + move_mm,
                     hubs[hub].rotation_rad + to.rotation_rad - from.rotation_rad};
    if (hub != leader_) device_.set_load(hub, {});
  }
}

/// Of what is wanted, as much as every hub can move.
double HubCouplings::common_move_mm(double wanted_mm, std::span<const HubPose> hubs,
                                    std::span<const HubLoad> loads) const {
  double move_mm = wanted_mm, sum_N = 0, largest_N = 0;
  for (std::size_t hub = 0; hub < hubs.size(); ++hub) {
    const double insertion_mm = hubs[hub].insertion_mm;
    move_mm = std::clamp(move_mm, -insertion_mm, max_insertions_mm_[hub] - insertion_mm);
    sum_N += loads[hub].force_N;
    largest_N = std::max(largest_N, loads[hub].force_N);
  }
  return std::max(sum_N, largest_N) > MovingHub::kMaxPush_N ? std::min(0.0, move_mm) : move_mm;
}

/// Locks or unlocks it where that is wanted, and changes the leader with the hub that is held.
void HubCouplings::move_valve(std::span<const HubPose> hubs) {
  const bool is_locked = wants_lock_.load(std::memory_order_relaxed);
  const std::size_t held = device_.held();
  if (is_locked == is_locked_ && (held == leader_ || !is_locked)) return;
  if (is_locked_)
    for (std::size_t hub = 0; hub < hubs.size(); ++hub)
      if (hub != leader_) release(hub, hubs[hub]);
  is_locked_ = is_locked;
  leader_ = held;
}

/// A hub that was led by another one goes on from where that brought it.
void HubCouplings::release(std::size_t hub, const HubPose& at) {
  device_.pose(hub);  // the newest, from which it counts
  device_.go_on_from(hub, at);
  couplings_[hub] = VirtualCoupling(at, settings_);
}

void HubCouplings::lead(std::size_t hub, const HubPose& at, const HubLoad& load, double step_s) {
  couplings_[hub].synchronise(at);
  const VirtualCoupling::Step step = couplings_[hub].step(device_.pose(hub), load, step_s);
  device_.set_load(hub, step.felt);
  targets_[hub] = step.hub;
}

}  // namespace xraycast
