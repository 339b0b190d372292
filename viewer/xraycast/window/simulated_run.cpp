#include "xraycast/window/simulated_run.hpp"

#include "xraycast/scene/catheter_surface.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <numbers>

namespace xraycast {
SimulatedRun::SimulatedRun(std::shared_ptr<const VesselTree> tree, const InstrumentModel& model,
                           const VesselEnd& entry, std::unique_ptr<HapticDevice> device)
    : tree_(std::move(tree)),
      model_(model),
      device_(std::move(device)),
      bolus_(*tree_),
      contrast_(*tree_),
      loop_(std::make_unique<Catheter>(*tree_, model, entry),
            [this](const HubPose& hub, const HubLoad& load, double step_s) {
              const HandPose hand = device_->pose();
              if (device_->is_rigid()) return hand.pose;
              coupling_.synchronise(hub);
              const VirtualCoupling::Step step = coupling_.step(hand, load, step_s);
              device_->feel(step.felt);
              return step.hub;
            }),
      now_(&loop_.snapshot()) {}

void SimulatedRun::update() {
  const double before_s = now_->time_s;
  now_ = &loop_.snapshot();
  const double passed_s = now_->time_s - before_s;
  if (passed_s <= 0) return;

  bolus_.step(passed_s, place_of(now_->tip), injection_ml_s_);
  injected_ml_ += passed_s * injection_ml_s_;
  loads_.push_back({now_->time_s, now_->load});
  while (loads_.front().time_s < now_->time_s - kKept_s) loads_.pop_front();
  if (is_recording_) recorded_.push_back({now_->time_s, now_->pose});
}

Surface SimulatedRun::catheter() const { return catheter_surface(now_->nodes_mm, model_.radius_mm()); }

Surface SimulatedRun::contrast() const { return contrast_.filled(bolus_.iodine_mg_ml()); }

void SimulatedRun::start_recording() {
  update();
  recorded_ = {{now_->time_s, now_->pose}};
  is_recording_ = true;
}

std::string SimulatedRun::stop_recording() {
  update();
  is_recording_ = false;
  std::string csv = "time_s,insertion_mm,rotation_deg\n";
  for (const Pose& row : recorded_)
    csv += fmt::format("{:.4f},{:.4f},{:.4f}\n", row.time_s - recorded_.front().time_s, row.pose.insertion_mm,
                       row.pose.rotation_rad * 180 / std::numbers::pi);
  return csv;
}

}  // namespace xraycast
