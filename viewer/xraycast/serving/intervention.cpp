#include "xraycast/serving/intervention.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/stderr_log.hpp"
#include "xraycast/geometry/moved_vessels.hpp"
#include "xraycast/haptics/igtlink_device.hpp"
#include "xraycast/haptics/script_device.hpp"
#include "xraycast/scene/catheter_surface.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <type_traits>
#include <utility>

namespace xraycast {
namespace {

const Intervention::Options& checked(const Intervention::Options& options) {
  check(options.run);
  if (options.exercise) check_allowed(*options.exercise, options.run.instruments);
  return options;
}

/// The presets or what an exercise allows, those that are in use as they are, and what else is.
std::vector<InstrumentModel> choices_of(const std::vector<InstrumentModel>& used,
                                        const std::optional<Exercise>& exercise) {
  std::vector<std::string> names = InstrumentModel::preset_names();
  if (exercise) {
    names = exercise->instruments;
    names.insert(names.end(), exercise->devices.begin(), exercise->devices.end());
  }
  std::vector<InstrumentModel> choices;
  for (const InstrumentModel& model : instruments_named(names))
    if (std::ranges::find(choices, model.name(), &InstrumentModel::name) == choices.end())
      choices.push_back(model);
  for (const InstrumentModel& model : used) {
    const auto same = std::ranges::find(choices, model.name(), &InstrumentModel::name);
    if (same == choices.end())
      choices.push_back(model);
    else
      *same = model;
  }
  return choices;
}

/// Vessels in the body at some phases.
VesselTree tree_at(const RunRequest& run, const VesselTree& tree, const std::vector<double>& phases) {
  return phases.empty() ? tree : moved(tree, run.body.motion->held_at(phases)).vessels;
}

std::unique_ptr<HapticDevice> make_device(const Intervention::Options& options) {
  if (options.make_device) return options.make_device();
  if (options.haptic == "openigtlink") {
    const ListenAddress address =
        options.listen.empty() ? ListenAddress{} : parse_listen_address(options.listen);
    return std::make_unique<IgtlinkDevice>(address, log_to_stderr, options.run.instruments.size());
  }
  const std::vector<std::string> names = Intervention::haptic_names();
  if (std::ranges::find(names, options.haptic) == names.end())
    throw InputError("haptic {}: must be one of {}", options.haptic, fmt::join(names, ", "));
  return std::make_unique<ManualDevice>(options.haptic);
}

}  // namespace

std::vector<std::string> Intervention::haptic_names() {
  return {"keyboard", "mouse", "gamepad", "openigtlink"};
}

Intervention::Intervention(const Options& options)
    : options_(checked(options)),
      moving_(SimulatedRun::Moving::of(options.run)),
      road_map_(tree_at(options.run, *options.run.tree, phases_at(options.run.body, 0))),
      choices_(choices_of(options.run.instruments, options.exercise)) {
  start(options.run.script, options.run.instruments);
}

void Intervention::start(const std::optional<Script>& script,
                         const std::vector<InstrumentModel>& instruments) {
  RunRequest request = options_.run;
  request.instruments = instruments;
  const auto hand_over = [&](std::unique_ptr<HapticDevice> to) {
    manual_ = dynamic_cast<ManualDevice*>(to.get());
    run_ = std::make_unique<SimulatedRun>(request, std::move(to), moving_, options_.exercise);
  };
  const bool was_recording = run_ && run_->is_recording();
  const Particles particles = run_ ? run_->particles() : Particles{};
  run_.reset();  // a port is free again
  try {
    hand_over(script ? std::make_unique<ScriptDevice>(*script) : make_device(options_));
  } catch (const Error&) {
    hand_over(std::make_unique<ManualDevice>("keyboard"));
    throw;
  }
  if (was_recording) run_->start_recording();
  run_->mix_in(particles);
  has_picture_ = false;
  refused_.reset();
  used_before_ = {};
  used_before_ = use();
}

/// In this run.
RunUse Intervention::use() const {
  const auto since = [](const auto& now, const auto& before) {
    using Value = std::remove_cvref_t<decltype(*now)>;
    return now ? std::optional<Value>(*now - before.value_or(0)) : std::nullopt;
  };
  RunUse now = generator_;
  if (!now.fluoroscopy_s) now.fluoroscopy_s = fluoroscopy_s_;
  return {.fluoroscopy_s = since(now.fluoroscopy_s, used_before_.fluoroscopy_s),
          .exposures = since(now.exposures, used_before_.exposures),
          .air_kerma_mGy = since(now.air_kerma_mGy, used_before_.air_kerma_mGy),
          .dap_Gycm2 = since(now.dap_Gycm2, used_before_.dap_Gycm2),
          .contrast_ml = run_->injected_ml(),
          .embolised = run_->embolised(),
          .tips_mmHg = run_->pressures().tip_means_mmHg()};
}

void Intervention::exchange(std::size_t instrument, const InstrumentModel& model) {
  refused_.reset();
  if (exchange_obstacle(instrument).empty())
    run_->exchange(instrument, model);
  else
    refused_ = instrument;
}

std::string Intervention::exchange_obstacle(std::size_t instrument) const {
  if (run_->is_recording()) return "stop the recording to exchange it";
  if (run_->now().instrument(instrument).pose.insertion_mm > Instruments::kDrawnBack_mm)
    return "draw it back to 0 mm to exchange it";
  return {};
}

std::string Intervention::note_on_exchange(std::size_t instrument) const {
  if (refused_ == instrument) return exchange_obstacle(instrument);
  const auto& refusal = run_->now().refusal;
  return refusal && refusal->instrument == instrument ? refusal->why : std::string();
}

void Intervention::hold_next_hub() {
  if (run_->has_valve()) run_->device().hold((held_hub() + 1) % run_->models().size());
}

void Intervention::toggle_valve() {
  if (run_->has_valve()) run_->lock_valve(!run_->is_valve_locked());
}

void Intervention::update(const CArmPose& pose, double passed_s) {
  constexpr double kPatience_s = 0.04;  // above the time between frames: no gate opens between two of them
  const bool is_open = !body() || body()->exposure_s(pedal_ ? kPatience_s : 0);
  run_->update();
  if (refused_ && exchange_obstacle(*refused_).empty()) refused_.reset();
  if (pedal_) fluoroscopy_s_ += passed_s;
  run_->monitor().use(use());
  // The first exposure needs no pedal, so that there is a picture to hold.
  has_exposed_ = !has_picture_ || (pedal_ && is_open);
  if (!has_exposed_) return;
  pose_ = pose;
  nodes_mm_.clear();
  for (std::size_t d = 0; d < run_->now().count(); ++d)
    nodes_mm_.push_back(run_->now().instrument(d).nodes_mm);
  exposed_ = run_->now().instruments;
  surfaces_ = surfaces_at(0);
  if (blur_.is_on())
    surfaces_ = seen_by_pulse(surfaces_at(-blur_.from_middle_s()), std::move(surfaces_),
                              surfaces_at(blur_.from_middle_s()), blur_.pixel_mm);
  drums_mg_ml_ = run_->drums_mg_ml();
  drums_moved_mm_ = run_->drums_moved_mm();
  phases_ = run_->now().phases;
  ++exposures_;
  has_picture_ = true;
}

std::vector<Surface> Intervention::surfaces_at(double later_s) const {
  std::vector<Surface> surfaces = run_->instruments(later_s);
  surfaces.push_back(run_->contrast(later_s));
  return surfaces;
}

SteeredInstruments Intervention::steered() const {
  SteeredInstruments steered{.instruments = {}, .has_road_map = has_road_map_};
  for (std::size_t d = 0; d < nodes_mm_.size(); ++d)
    steered.instruments.push_back(drawn((*exposed_)[d], nodes_mm_[d]));
  return steered;
}

std::string Intervention::caption(const CArmPose& now) const {
  if (!has_picture_) return status_of(now);
  if (pedal_ || pose_ == now) return status_of(pose_);
  return fmt::format("held: {}; C-arm: {}", status_of(pose_), status_of(now));
}

void Intervention::show_road_map(bool shows) {
  if (shows && !has_road_map_) road_map_ = RoadMap(tree_at(options_.run, run_->treated_tree(), phases_));
  has_road_map_ = shows;
}

std::span<const glm::ivec2> Intervention::road_map(const View& view) {
  if (!has_road_map_) return {};
  return road_map_.outline(view);
}

}  // namespace xraycast
