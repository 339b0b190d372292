#include "xraycast/serving/web_outlet.hpp"

#include "xraycast/scene/instrument_curve.hpp"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <utility>

namespace xraycast {

WebOutlet::WebOutlet(const WebServer::Options& options, std::string page, const BodyBounds& bounds,
                     bool moves_hub, std::function<void(const std::string&)> log)
    : moves_hub_(moves_hub),
      hand_(bounds.centre_mm.z),
      server_(
          options, std::move(page),
          {.steer = [this](std::string_view text) { return hand_.receive(text, BrowserHand::Clock::now()); },
           .let_go = [this] { hand_.let_go(); },
           .log = std::move(log)}) {}

LiveCommands WebOutlet::commands() {
  LiveCommands commands = hand_.commands(BrowserHand::Clock::now());
  if (moves_hub_) return commands;
  commands.insertion_mm_s = commands.rotation_rad_s = 0;
  commands.next_hubs = commands.valve_toggles = 0;
  commands.balloons_bar = commands.sheaths_mm = {};
  commands.detaches = {};
  return commands;
}

void WebOutlet::publish(const LiveFrame& frame) {
  server_.check();
  if (server_.browsers() == 0) return;
  const Intervention& intervention = frame.intervention;
  const SimulatedRun& run = intervention.run();
  const CatheterSnapshot& now = run.now();
  message_.time_s = now.time_s;
  message_.fluoroscopy_s = intervention.fluoroscopy_s();
  message_.injected_ml = run.injected_ml();
  message_.packing = 0;
  if (now.coiled)
    for (const CoiledSac& sac : *now.coiled) message_.packing = std::max(message_.packing, sac.packing);
  message_.aortic_mmHg = run.pressures().aorta().now_mmHg;
  message_.exposes = intervention.is_live();
  message_.injects = run.injection_ml_s() > 0;
  message_.is_valve_locked = run.is_valve_locked();
  message_.has_outlet = now.agent_outlet.has_value();
  message_.held_hub = run.held_hub();
  message_.instruments.resize(now.count());
  for (std::size_t d = 0; d < now.count(); ++d) {
    message_.instruments[d].pose = now.instrument(d).pose;
    message_.instruments[d].load = now.instrument(d).load;
    const InstrumentTip& tip = now.instrument(d).tip;
    message_.instruments[d].tip_branch = static_cast<std::size_t>(tip.branch);
    message_.instruments[d].tip_along_mm = tip.arc_length_mm;
    message_.instruments[d].coil = now.instrument(d).coil;
    message_.instruments[d].pressure = run.pressures().tip(d);
    tell_treating(message_.instruments[d], run.models()[d], treating_view(now.instrument(d)));
  }
  if (message_.exposures != static_cast<std::uint32_t>(intervention.exposures())) take_exposure(intervention);
  if (LiveBody* body = frame.body) take_body(*body);
  server_.publish(packed(message_));
  if (intervention.exercise()) tell_exercise(intervention);
}

/// What is new of how far it is, twice a second.
void WebOutlet::tell_exercise(const Intervention& intervention) {
  constexpr double kInterval_s = 0.5;
  const SimulatedRun& run = intervention.run();
  const double now_s = run.now().time_s;
  if (told_s_ >= 0 && now_s >= told_s_ && now_s < told_s_ + kInterval_s) return;
  told_s_ = now_s;
  const auto report = nlohmann::ordered_json::parse(run.monitor().json(false), nullptr, false);
  if (!report.is_object()) return;  // before the first step
  nlohmann::ordered_json exercise = report.at("exercise");
  exercise["task"] = intervention.exercise()->task;
  const std::string text = exercise.dump();
  if (text == told_) return;
  told_ = text;
  server_.tell(text);
}

/// What is new of the traces, and how the operator has the body.
void WebOutlet::take_body(LiveBody& body) {
  const BodyTraces& traces = body.traces();
  const std::vector<BodyModeState> modes = body.modes();
  message_.body_time_s = traces.end_s;
  message_.body_speed = body.speed();
  message_.modes.resize(modes.size());
  for (std::size_t m = 0; m < modes.size(); ++m) {
    BrowserMessage::Mode& mode = message_.modes[m];
    mode.is_held = modes[m].is_held;
    mode.is_gate = body.gate() && body.gate()->mode == modes[m].name;
    mode.gate = mode.is_gate ? body.gate()->phase : 0;
    const auto fresh = std::min<std::int64_t>(traces.count - traced_, std::ssize(traces.samples[m]));
    mode.trace.assign(traces.samples[m].end() - fresh, traces.samples[m].end());
  }
  traced_ = traces.count;
  message_.exposures_s.clear();
  for (const double time_s : traces.exposures_s)
    if (time_s > marked_s_) message_.exposures_s.push_back(time_s);
  if (!message_.exposures_s.empty()) marked_s_ = message_.exposures_s.back();
}

/// The picture is held until the next exposure, so that shapes are packed for each exposure alone, in the
/// frame that made it.
void WebOutlet::take_exposure(const Intervention& intervention) {
  message_.exposures = static_cast<std::uint32_t>(intervention.exposures());
  const SteeredInstruments steered = intervention.steered();
  for (std::size_t d = 0; d < steered.instruments.size() && d < message_.instruments.size(); ++d) {
    auto& parts_mm = message_.instruments[d].parts_mm;
    parts_mm.clear();
    const SteeredInstruments::Instrument& instrument = steered.instruments[d];
    for (const std::vector<glm::dvec3>& length_mm : lengths_of(instrument.nodes_mm, instrument.markers))
      parts_mm.push_back(controls_of(length_mm));
  }
  message_.devices = intervention.run().devices();
  message_.drums_mg_ml = intervention.drums_mg_ml();
  message_.drums_mm = intervention.run().drums_mm();
  message_.drums_moved_mm = intervention.drums_moved_mm();
  message_.modes.resize(intervention.phases().size());
  for (std::size_t m = 0; m < message_.modes.size(); ++m) message_.modes[m].phase = intervention.phases()[m];
}

}  // namespace xraycast
