#include "xraycast/trainer/trainer.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/contrast_agent/agent_outlet.hpp"
#include "xraycast/haptics/hand_rates.hpp"
#include "xraycast/scene/instrument_curve.hpp"
#include "xraycast/simulation/coiling.hpp"
#include "xraycast/simulation/instrument_pressures.hpp"

#include <algorithm>
#include <array>
#include <iterator>
#include <utility>

namespace xraycast {
namespace {

/// Of a millilitre of iodine, which the page has its own of.
constexpr double kAnyAttenuation_per_mm = 1;

std::optional<ExerciseProgress> progress_of(const TrainerSetup& setup) {
  if (setup.exercise.empty()) return std::nullopt;
  return ExerciseProgress(parse_exercise(setup.exercise, "exercise", *setup.tree), *setup.tree);
}

std::optional<TrainerBody> body_of(const TrainerSetup& setup) {
  if (setup.motion.modes.empty()) return std::nullopt;
  return TrainerBody(setup.motion.motion());
}

Instruments::Options in_body(const std::optional<TrainerBody>& body) {
  Instruments::Options options;
  if (body) {
    options.motion = body->motion();
    options.phases = body->phases();
  }
  return options;
}

}  // namespace

std::array<double, kPoseNumbers> numbers_of(const HubPose& pose) {
  return {pose.insertion_mm, pose.rotation_rad, pose.inflation_bar, pose.release_mm, pose.detach};
}

HubPose pose_of(std::span<const double, kPoseNumbers> numbers) {
  return {numbers[0], numbers[1], numbers[2], numbers[3], numbers[4]};
}

Trainer::Trainer(TrainerSetup setup)
    : setup_(std::move(setup)),
      body_(body_of(setup_)),
      instruments_(*setup_.tree, setup_.instruments(), setup_.entry, in_body(body_)),
      couplings_(device_, max_insertions_mm(setup_.instruments())),
      bolus_(*setup_.tree),
      contrast_(*setup_.tree, kAnyAttenuation_per_mm),
      monitor_(instruments_, names_of(setup_.instruments()), progress_of(setup_)) {
  message_.instruments.resize(instruments_.count());
  pressures_.add(0, bolus_.flow(), tips_of(instruments_));
}

void Trainer::hold_next_hub() { device_.hold((device_.held() + 1) % instruments_.count()); }

void Trainer::toggle_valve() {
  if (instruments_.count() > 1) couplings_.lock(!couplings_.is_locked());
}

void Trainer::inflate(std::size_t instrument, double bar) {
  if (instrument < instruments_.count()) couplings_.inflate(instrument, bar);
}

void Trainer::draw_sheath(std::size_t instrument, double mm) {
  if (instrument < instruments_.count()) couplings_.draw_sheath(instrument, mm);
}

void Trainer::detach(std::size_t instrument) {
  if (instrument < instruments_.count() && setup_.choices[setup_.used[instrument]].has_coils())
    couplings_.detach_next(instrument);
}

void Trainer::exchange(std::size_t instrument, std::size_t choice) {
  if (instrument >= instruments_.count() || choice >= setup_.choices.size())
    throw InputError("there is no instrument {} or {}", instrument, choice);
  instruments_.exchange(instrument, setup_.choices[choice]);
  setup_.used[instrument] = choice;
  poses_.clear();  // of a recording that begins anew
  monitor_.exchanged(instrument, instruments_, setup_.choices[choice].name());
  couplings_.replace(instrument, {}, instruments_.max_insertion_mm(instrument));
}

void Trainer::advance(int steps) {
  const double speed = hand_.is_slow ? kSlowly : 1;
  device_.set_rates(speed * kPush_mm_s * hand_.push, speed * kRotate_rad_s * hand_.turn);
  const std::size_t count = instruments_.count();
  std::array<HubPose, kMaxHubs> poses;
  std::array<HubLoad, kMaxHubs> loads;
  for (; steps > 0; --steps) {
    for (std::size_t d = 0; d < count; ++d) {
      poses[d] = instruments_.pose(d);
      loads[d] = instruments_.load(d);
    }
    step(couplings_.step({poses.data(), count}, {loads.data(), count}, instruments_.step_s()));
  }
}

void Trainer::follow(std::span<const HubPose> poses) {
  step(poses);
  for (std::size_t d = 0; d < poses.size(); ++d)
    couplings_.replace(d, instruments_.pose(d), instruments_.max_insertion_mm(d));
}

void Trainer::step(std::span<const HubPose> poses) {
  if (body_)
    instruments_.step(poses, body_->advance(instruments_.step_s()));
  else
    instruments_.step(poses);
  count_step();
}

void Trainer::count_step() {
  constexpr double kFlow_s =
      0.02;  // by which blood and its pressure are told apart, however late messages are
  if (instruments_.time_s() - told_s_ >= kFlow_s) let_flow();
  monitor_.add(instruments_, {.fluoroscopy_s = message_.fluoroscopy_s,
                              .exposures = pulses_,
                              .air_kerma_mGy = air_kerma_mGy_,
                              .dap_Gycm2 = dap_Gycm2_,
                              .contrast_ml = message_.injected_ml,
                              .embolised = embolised_,
                              .tips_mmHg = pressures_.tip_means_mmHg()});
  poses_.push_back(instruments_.time_s());
  for (std::size_t d = 0; d < instruments_.count(); ++d)
    for (const double number : numbers_of(instruments_.pose(d))) poses_.push_back(number);
}

std::vector<double> Trainer::take_steps() { return std::exchange(poses_, {}); }

std::string Trainer::message() {
  let_flow();
  message_.exposes = hand_.pedal;
  message_.injects = hand_.injects;
  message_.is_valve_locked = couplings_.is_locked();
  message_.held_hub = device_.held();
  for (std::size_t d = 0; d < instruments_.count(); ++d) {
    message_.instruments[d].pose = instruments_.pose(d);
    message_.instruments[d].load = instruments_.load(d);
    const InstrumentTip tip = instruments_.tip(d);
    message_.instruments[d].tip_branch = static_cast<std::size_t>(tip.branch);
    message_.instruments[d].tip_along_mm = tip.arc_length_mm;
    message_.instruments[d].coil = instruments_.pushed_coil(d);
    message_.instruments[d].pressure = pressures_.tip(d);
    tell_treating(message_.instruments[d], instruments_.rod(d).instrument(), treating_view(instruments_, d));
  }
  message_.packing = 0;
  for (const CoilPack& pack : instruments_.coil_packs())
    message_.packing = std::max(message_.packing, pack.packing());
  message_.aortic_mmHg = pressures_.aorta().now_mmHg;
  const bool is_gate_open = this->is_gate_open();
  if (message_.exposures == 0 || (is_gate_open && is_pulse_due())) expose();
  if (body_) body_->tell(message_);
  return packed(message_);
}

/// Then the next exposure's phases are known.
bool Trainer::is_gate_open() {
  if (!body_) return true;
  const std::optional<std::vector<double>> phases = body_->exposure_phases();
  exposed_phases_ = phases ? *phases : body_->phases();
  return phases.has_value();
}

/// By the simulation's time. Pulses that messages came too late for are not made up for.
bool Trainer::is_pulse_due() {
  const double now_s = instruments_.time_s();
  if (!hand_.pedal) {
    due_s_ = now_s;
    return false;
  }
  if (pulses_per_s_ <= 0) return true;
  if (now_s < due_s_) return false;
  due_s_ = std::max(due_s_ + 1 / pulses_per_s_, now_s + 0.5 / pulses_per_s_);
  return true;
}

void Trainer::let_flow() {
  const double passed_s = instruments_.time_s() - told_s_;
  const std::optional<std::size_t> outlet = agent_outlet(instruments_);
  message_.time_s = told_s_ = instruments_.time_s();
  message_.has_outlet = outlet.has_value();
  if (passed_s <= 0) return;
  take_vessels();
  take_coils(instruments_, bolus_);
  bolus_.flow().fill(fillings_of(*setup_.tree, instruments_));
  const double ml_s = hand_.injects && outlet ? kInjection_ml_s : 0;
  bolus_.step(passed_s, location_of(instruments_.tip(outlet.value_or(0))), ml_s, Injection{}.agent_mg_ml,
              particles_.through(agent_lumen_mm(instruments_)));
  pressures_.add(instruments_.time_s(), bolus_.flow(), tips_of(instruments_));
  message_.injected_ml += ml_s * passed_s;
  if (particles_.are_any() || !embolised_.empty()) embolised_ = bolus_.flow().embolisation().list();
  if (hand_.pedal) pedal_s_ += passed_s;
  message_.fluoroscopy_s = fluoroscopy_s_.value_or(pedal_s_);
}

/// As balloons and stents have left them.
void Trainer::take_vessels() {
  if (std::exchange(vessel_changes_, instruments_.vessel_changes()) == instruments_.vessel_changes()) return;
  const VesselTree widened = instruments_.widened_tree();
  contrast_ = ContrastSurface(widened, kAnyAttenuation_per_mm);
  bolus_.take_radii(widened);
}

std::vector<DeviceTube> Trainer::devices(std::span<const std::vector<glm::dvec3>> nodes_mm) const {
  std::vector<DeviceTube> all;
  const auto add = [&](std::vector<DeviceTube> tubes) {
    std::move(tubes.begin(), tubes.end(), std::back_inserter(all));
  };
  for (std::size_t d = 0; d < instruments_.count(); ++d)
    add(treating_tubes(nodes_mm[d], instruments_.rod(d).instrument(), treating_view(instruments_, d)));
  const std::size_t carried = all.size();
  for (const PlacedStent& stent : instruments_.treatments().stents()) add(stent_tubes(stent, *setup_.tree));
  add(laid_coil_tubes(instruments_));
  if (body_ && all.size() > carried) {
    const HeldMotion held = body_->motion()->held_at(exposed_phases_);
    for (std::size_t t = carried; t < all.size(); ++t)
      for (VesselPoint& point : all[t].points) point.position_mm = held.inverse_mm(point.position_mm).x_mm;
  }
  for (std::size_t d = 0; d < instruments_.count(); ++d)
    if (const std::optional<PushedCoil> pushed = instruments_.pushed_coil(d))
      all.push_back(pushed_coil_tube(*pushed, nodes_mm[pushed->around]));
  return all;
}

void Trainer::expose() {
  ++message_.exposures;
  if (hand_.pedal) ++pulses_;
  std::vector<std::vector<glm::dvec3>> all_nodes_mm(instruments_.count());
  for (std::size_t d = 0; d < instruments_.count(); ++d) {
    std::vector<glm::dvec3>& nodes_mm = all_nodes_mm[d];
    instruments_.copy_nodes(d, nodes_mm);
    const std::vector<MarkerModel>& markers = setup_.choices[setup_.used[d]].markers();
    auto& parts_mm = message_.instruments[d].parts_mm;
    parts_mm.clear();
    for (const std::vector<glm::dvec3>& length_mm : lengths_of(nodes_mm, markers))
      parts_mm.push_back(controls_of(length_mm));
  }
  if (body_) {
    if (hand_.pedal) body_->mark_exposure();
    message_.modes.resize(exposed_phases_.size());
    for (std::size_t m = 0; m < exposed_phases_.size(); ++m) message_.modes[m].phase = exposed_phases_[m];
  }
  message_.drums_mm = contrast_.radii_mm();
  message_.devices = devices(all_nodes_mm);
  message_.drums_mg_ml = contrast_.drums_mg_ml(bolus_.iodine_mg_ml());
}

}  // namespace xraycast
