#include "xraycast/serving/simulated_run.hpp"

#include "xraycast/scene/catheter_surface.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <numbers>

namespace xraycast {
namespace {

std::vector<double> max_insertions_mm(const std::vector<InstrumentModel>& models) {
  std::vector<double> insertions_mm;
  for (const InstrumentModel& model : models) insertions_mm.push_back(max_insertion_mm(model));
  return insertions_mm;
}

}  // namespace

SimulatedRun::SimulatedRun(const RunRequest& request, std::unique_ptr<HapticDevice> device)
    : tree_(request.tree),
      device_(std::move(device)),
      couplings_(*device_, max_insertions_mm(request.instruments)),
      bolus_(*tree_),
      contrast_(*tree_),
      loop_(
          std::make_unique<Instruments>(*tree_, request.instruments, entry_of(request)),
          [this](std::span<const HubPose> hubs, std::span<const HubLoad> loads, double step_s) {
            return couplings_.step(hubs, loads, step_s);
          },
          [this](std::size_t hub, const InstrumentModel& instrument) {
            couplings_.replace(hub, {}, max_insertion_mm(instrument));
          }),
      now_(&loop_.snapshot()) {}

void SimulatedRun::update() {
  const double before_s = now_->time_s;
  now_ = &loop_.snapshot();
  const double passed_s = now_->time_s - before_s;
  if (passed_s <= 0) return;

  const double injection_ml_s = now_->agent_outlet ? injection_ml_s_ : 0;
  bolus_.step(passed_s, place_of(now_->instrument(now_->agent_outlet.value_or(0)).tip), injection_ml_s);
  injected_ml_ += passed_s * injection_ml_s;
  Load load{now_->time_s, {}};
  for (std::size_t d = 0; d < now_->count(); ++d) load.hubs[d] = now_->instrument(d).load;
  loads_.push_back(load);
  while (loads_.front().time_s < now_->time_s - kKept_s) loads_.pop_front();
  if (is_recording_) record();
}

std::vector<Surface> SimulatedRun::instruments() const {
  std::vector<Surface> surfaces;
  for (std::size_t d = 0; d < now_->count(); ++d)
    for (Surface& surface : instrument_surfaces(now_->instrument(d).nodes_mm, models()[d]))
      surfaces.push_back(std::move(surface));
  return surfaces;
}

Surface SimulatedRun::contrast() const { return contrast_.filled(bolus_.iodine_mg_ml()); }

void SimulatedRun::record() {
  // An exchange that was asked for before: the recording begins with the new instrument.
  if (recorded_of_ != now_->instruments) recorded_.clear();
  recorded_of_ = now_->instruments;
  Poses poses{now_->time_s, {}};
  for (std::size_t d = 0; d < now_->count(); ++d) poses.hubs[d] = now_->instrument(d).pose;
  recorded_.push_back(poses);
}

void SimulatedRun::start_recording() {
  update();
  recorded_.clear();
  record();
  is_recording_ = true;
}

std::string SimulatedRun::stop_recording() {
  update();
  is_recording_ = false;
  std::string csv = "time_s,insertion_mm,rotation_deg";
  for (std::size_t d = 1; d < now_->count(); ++d)
    csv += fmt::format(",insertion_{0}_mm,rotation_{0}_deg", d + 1);
  csv += '\n';
  for (const Poses& row : recorded_) {
    csv += fmt::format("{:.4f}", row.time_s - recorded_.front().time_s);
    for (std::size_t d = 0; d < now_->count(); ++d)
      csv += fmt::format(",{:.4f},{:.4f}", row.hubs[d].insertion_mm,
                         row.hubs[d].rotation_rad * 180 / std::numbers::pi);
    csv += '\n';
  }
  return csv;
}

}  // namespace xraycast
