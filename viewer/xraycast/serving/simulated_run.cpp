#include "xraycast/serving/simulated_run.hpp"

#include "xraycast/scene/catheter_surface.hpp"
#include "xraycast/scene/device_surface.hpp"
#include "xraycast/scene/pulse_blur.hpp"
#include "xraycast/simulation/script.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <numbers>

namespace xraycast {
namespace {

/// The introducer is where the entry is in the body now.
Instruments::Options options_in(const RunRequest& request, const SimulatedRun::Moving& moving) {
  Instruments::Options options = instrument_options(request);
  if (moving.body) options.phases = moving.body->phases();
  return options;
}

SimulationLoop::Body clock_of_body(const SimulatedRun::Moving& moving) {
  if (!moving.body) return {};
  return [body = moving.body](double step_s) { return body->advance(step_s); };
}

}  // namespace

TreatingView treating_view(const InstrumentSnapshot& instrument) {
  return {instrument.balloon_bar, instrument.carried_rings, instrument.pose.release_mm};
}

SimulatedRun::Moving SimulatedRun::Moving::of(const RunRequest& request) {
  if (!request.body.motion) return {};
  Progress progress;
  return {std::make_shared<LiveBody>(request.body),
          std::make_shared<const MovingPoints>(ContrastSurface(*request.tree).whole().mesh.points_mm,
                                               *request.body.motion, progress)};
}

SimulatedRun::SimulatedRun(const RunRequest& request, std::unique_ptr<HapticDevice> device, Moving moving,
                           const std::optional<Exercise>& exercise)
    : tree_(request.tree),
      device_(std::move(device)),
      entry_(entry_of(request)),
      couplings_(*device_, max_insertions_mm(request.instruments)),
      bolus_(*tree_, request.blood),
      contrast_(*tree_),
      moving_(std::move(moving)),
      motion_(request.body.motion),
      body_from_s_(moving_.body ? moving_.body->time_s() : 0),
      monitor_(progress_of(exercise, *tree_)),
      loop_(
          std::make_unique<Instruments>(*tree_, request.instruments, entry_, options_in(request, moving_)),
          [this](std::span<const HubPose> hubs, std::span<const HubLoad> loads, double step_s) {
            return couplings_.step(hubs, loads, step_s);
          },
          [this](std::size_t hub, const InstrumentModel& instrument) {
            couplings_.replace(hub, {}, max_insertion_mm(instrument));
          },
          clock_of_body(moving_),
          [this](const Instruments& instruments, std::optional<std::size_t> exchanged) {
            monitor_.add(instruments, exchanged);
          }),
      now_(&loop_.snapshot()) {}

void SimulatedRun::update() {
  const double before_s = now_->time_s;
  before_mm_.resize(now_->count());
  for (std::size_t d = 0; d < now_->count(); ++d) before_mm_[d] = now_->instrument(d).nodes_mm;
  now_ = &loop_.snapshot();
  passed_s_ = now_->time_s - before_s;
  if (passed_s_ <= 0) return;

  if (now_->treated != treated_) take_vessels();
  if (now_->coiled != coiled_ || has_attached_coil()) take_coils();
  const double injection_ml_s = now_->agent_outlet ? injection_ml_s_ : 0;
  bolus_.flow().fill(fillings());
  bolus_.step(passed_s_, location_of(now_->instrument(now_->agent_outlet.value_or(0)).tip), injection_ml_s,
              Injection{}.agent_mg_ml, particles_.through(now_->agent_lumen_mm));
  injected_ml_ += passed_s_ * injection_ml_s;
  std::vector<InstrumentTip> tips;
  for (std::size_t d = 0; d < now_->count(); ++d) tips.push_back(now_->instrument(d).tip);
  pressures_.add(now_->time_s, bolus_.flow(), tips);
  Load load{now_->time_s, {}, {}};
  for (std::size_t d = 0; d < now_->count(); ++d) {
    load.hubs[d] = now_->instrument(d).load;
    load.tips_mmHg[d] = pressures_.tip(d).now_mmHg;
  }
  loads_.push_back(load);
  while (loads_.front().time_s < now_->time_s - kKept_s) loads_.pop_front();
  if (is_recording_) record();
}

std::vector<TreeFlow::Filling> SimulatedRun::fillings() const {
  std::vector<TreeFlow::Filling> all;
  for (std::size_t d = 0; d < now_->count(); ++d) {
    if (now_->instrument(d).pose.insertion_mm <= 0) continue;
    for (const TreeFlow::Filling& filling :
         fillings_of(*tree_, entry_, now_->instrument(d).tip, models()[d].radius_mm()))
      all.push_back(filling);
    for (const TreeFlow::Filling& filling : fillings_of(now_->instrument(d).balloon_lengths))
      all.push_back(filling);
  }
  return all;
}

void SimulatedRun::take_vessels() {
  treated_ = now_->treated;
  const VesselTree widened = treated_->walls.widened(*tree_);
  contrast_ = ContrastSurface(widened);
  bolus_.take_radii(widened);
  stents_.clear();
  for (const PlacedStent& stent : treated_->stents)
    for (DeviceTube& tube : stent_tubes(stent, *tree_)) stents_.push_back(std::move(tube));
  if (!motion_) {
    stent_surfaces_ = device_surfaces(stents_);
    return;
  }
  Progress progress;
  moving_.contrast =
      std::make_shared<const MovingPoints>(contrast_.whole().mesh.points_mm, *motion_, progress);
  stent_points_.clear();
  for (const DeviceTube& tube : stents_) {
    std::vector<glm::vec3> points_mm;
    for (const VesselPoint& point : tube.points) points_mm.emplace_back(point.position_mm);
    stent_points_.emplace_back(points_mm, *motion_, progress);
  }
}

/// One that hangs from a catheter, which moves.
bool SimulatedRun::has_attached_coil() const {
  for (std::size_t d = 0; d < now_->count(); ++d)
    if (const auto& coil = now_->instrument(d).coil; coil && coil->laid_mm > 0) return true;
  return false;
}

void SimulatedRun::take_coils() {
  coiled_ = now_->coiled;
  coils_.clear();
  for (std::size_t s = 0; s < coiled_->size(); ++s) {
    const CoiledSac& sac = (*coiled_)[s];
    bolus_.pack(s, {sac.packing, sac.wire_mm});
    for (const LaidCoil& coil : sac.coils) {
      const std::optional<PushedCoil>& pushed = now_->instrument(coil.instrument).coil;
      coils_.push_back(pushed ? coil_tube(coil, now_->instrument(pushed->around).tip.scan_mm)
                              : coil_tube(coil));
    }
  }
  if (!motion_) coil_surfaces_ = device_surfaces(coils_);
}

/// Where the body shows them now.
std::vector<DeviceTube> SimulatedRun::moved_coils() const {
  std::vector<DeviceTube> moved = coils_;
  if (motion_ && !now_->phases.empty()) move_into(motion_->held_at(now_->phases), moved);
  return moved;
}

std::vector<Surface> SimulatedRun::instruments(double later_s) const {
  std::vector<Surface> surfaces;
  for (std::size_t d = 0; d < now_->count(); ++d)
    for (Surface& surface :
         instrument_surfaces(nodes_of(d, later_s), models()[d], treating_view(now_->instrument(d))))
      surfaces.push_back(std::move(surface));
  const std::vector<Surface> stents = motion_ ? device_surfaces(moved_stents()) : stent_surfaces_;
  surfaces.insert(surfaces.end(), stents.begin(), stents.end());
  const std::vector<Surface> coils = motion_ ? device_surfaces(moved_coils()) : coil_surfaces_;
  surfaces.insert(surfaces.end(), coils.begin(), coils.end());
  for (std::size_t d = 0; d < now_->count(); ++d)
    if (const std::optional<PushedCoil>& pushed = now_->instrument(d).coil)
      surfaces.push_back(device_surface(pushed_coil_tube(*pushed, nodes_of(pushed->around, later_s))));
  return surfaces;
}

std::vector<DeviceTube> SimulatedRun::moved_stents() const {
  std::vector<DeviceTube> moved = stents_;
  for (std::size_t s = 0; s < stent_points_.size(); ++s) {
    const auto points_mm = stent_points_[s].at(now_->phases);
    for (std::size_t i = 0; i < moved[s].points.size(); ++i) moved[s].points[i].position_mm = points_mm[i];
  }
  return moved;
}

std::vector<DeviceTube> SimulatedRun::devices() const {
  std::vector<DeviceTube> all;
  for (std::size_t d = 0; d < now_->count(); ++d) {
    const InstrumentSnapshot& instrument = now_->instrument(d);
    for (DeviceTube& tube : treating_tubes(instrument.nodes_mm, models()[d], treating_view(instrument)))
      all.push_back(std::move(tube));
  }
  for (DeviceTube& tube : moved_stents()) all.push_back(std::move(tube));
  for (DeviceTube& tube : moved_coils()) all.push_back(std::move(tube));
  for (std::size_t d = 0; d < now_->count(); ++d)
    if (const std::optional<PushedCoil>& pushed = now_->instrument(d).coil)
      all.push_back(pushed_coil_tube(*pushed, now_->instrument(pushed->around).nodes_mm));
  return all;
}

std::vector<glm::dvec3> SimulatedRun::nodes_of(std::size_t instrument, double later_s) const {
  const std::vector<glm::dvec3>& nodes_mm = now_->instrument(instrument).nodes_mm;
  constexpr double kLongest_s = 0.1;  // after which a way says nothing of the speed
  const bool is_known = instrument < before_mm_.size() && passed_s_ < kLongest_s;
  return later_s == 0 || !is_known ? nodes_mm
                                   : moved_on(nodes_mm, before_mm_[instrument], passed_s_, later_s);
}

Surface SimulatedRun::contrast(double later_s) const {
  if (!moving_.contrast) return contrast_.filled(bolus_.iodine_mg_ml());
  const std::vector<double> phases =
      later_s == 0 ? now_->phases : moving_.body->phases_at(body_from_s_ + now_->time_s + later_s);
  return contrast_.filled(bolus_.iodine_mg_ml(), moving_.contrast->at(phases));
}

std::vector<glm::vec3> SimulatedRun::drums_moved_mm() const {
  if (!moving_.contrast) return {};
  return contrast_.drums_moved_mm(moving_.contrast->at(now_->phases));
}

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
  std::string csv = "time_s";
  for (std::size_t d = 0; d < now_->count(); ++d) csv += ',' + insertion_column(d) + ',' + rotation_column(d);
  for (std::size_t d = 0; d < now_->count(); ++d)
    if (models()[d].balloon()) csv += ',' + inflation_column(d);
  for (std::size_t d = 0; d < now_->count(); ++d)
    if (models()[d].has_sheath()) csv += ',' + release_column(d);
  for (std::size_t d = 0; d < now_->count(); ++d)
    if (models()[d].has_coils()) csv += ',' + detach_column(d);
  csv += '\n';
  for (const Poses& row : recorded_) {
    csv += fmt::format("{:.4f}", row.time_s - recorded_.front().time_s);
    for (std::size_t d = 0; d < now_->count(); ++d)
      csv += fmt::format(",{:.4f},{:.4f}", row.hubs[d].insertion_mm,
                         row.hubs[d].rotation_rad * 180 / std::numbers::pi);
    for (std::size_t d = 0; d < now_->count(); ++d)
      if (models()[d].balloon()) csv += fmt::format(",{:.4f}", row.hubs[d].inflation_bar);
    for (std::size_t d = 0; d < now_->count(); ++d)
      if (models()[d].has_sheath()) csv += fmt::format(",{:.4f}", row.hubs[d].release_mm);
    for (std::size_t d = 0; d < now_->count(); ++d)
      if (models()[d].has_coils())
        csv += fmt::format(",{:.0f}", row.hubs[d].detach - recorded_.front().hubs[d].detach);
    csv += '\n';
  }
  return csv;
}

}  // namespace xraycast
