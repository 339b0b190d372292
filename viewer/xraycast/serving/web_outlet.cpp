#include "xraycast/serving/web_outlet.hpp"

#include "xraycast/export/recorded_run.hpp"
#include "xraycast/scene/catheter_surface.hpp"

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
  message_.exposes = intervention.is_live();
  message_.injects = run.injection_ml_s() > 0;
  message_.is_valve_locked = run.is_valve_locked();
  message_.has_outlet = now.agent_outlet.has_value();
  message_.held_hub = run.held_hub();
  message_.instruments.resize(now.count());
  for (std::size_t d = 0; d < now.count(); ++d) {
    message_.instruments[d].pose = now.instrument(d).pose;
    message_.instruments[d].load = now.instrument(d).load;
  }
  if (message_.exposures != static_cast<std::uint32_t>(intervention.exposures())) take_exposure(intervention);
  server_.publish(packed(message_));
}

/// The picture is held until the next exposure, so that shapes are packed for each exposure alone.
void WebOutlet::take_exposure(const Intervention& intervention) {
  message_.exposures = static_cast<std::uint32_t>(intervention.exposures());
  const SteeredInstruments steered = intervention.steered();
  for (std::size_t d = 0; d < steered.instruments.size() && d < message_.instruments.size(); ++d) {
    auto& parts_mm = message_.instruments[d].parts_mm;
    parts_mm.clear();
    for (const InstrumentPart& part :
         instrument_parts(steered.instruments[d].nodes_mm, steered.instruments[d].has_lumen))
      parts_mm.push_back(controls_of(part.nodes_mm));
  }
  message_.drums_mg_ml = intervention.drums_mg_ml();
}

}  // namespace xraycast
