// What a page's worker calls of the simulation, which `./dev page` compiles to WebAssembly (docs/web.md). One
// trainer is open at a time. Functions that can fail return null, or a line that says why and stays until the
// next call.
#include "xraycast/trainer/trainer.hpp"

#include "calls.hpp"

#include <cstdint>
#include <emscripten/emscripten.h>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace {

using xraycast::page::failure_of, xraycast::page::numbers;
using xraycast::page::text;

std::unique_ptr<xraycast::Trainer> trainer;

}  // namespace

extern "C" {

/// Takes the setup (viewer/xraycast/trainer/trainer_setup.hpp).
EMSCRIPTEN_KEEPALIVE const char* trainer_open() {
  return failure_of(
      [] { trainer = std::make_unique<xraycast::Trainer>(xraycast::trainer_setup_of(numbers)); });
}

EMSCRIPTEN_KEEPALIVE void trainer_hold(double push, double turn, bool is_slow, bool pedal, bool injects) {
  trainer->hold({push, turn, is_slow, pedal, injects});
}
EMSCRIPTEN_KEEPALIVE void trainer_pulse_rate(double per_s) { trainer->set_pulse_rate(per_s); }
EMSCRIPTEN_KEEPALIVE void trainer_dose(double fluoroscopy_s, double air_kerma_mGy, double dap_Gycm2) {
  trainer->count_dose(fluoroscopy_s, air_kerma_mGy, dap_Gycm2);
}
/// Of a body in motion: a mode is held, at a phase unless that is below 0, or goes on.
EMSCRIPTEN_KEEPALIVE const char* trainer_hold_mode(std::size_t mode, bool holds, double phase) {
  return failure_of([&] {
    xraycast::TrainerBody* const body = trainer->body();
    if (!body) return;
    if (!holds)
      body->release(mode);
    else if (phase >= 0)
      body->hold(mode, phase);
    else
      body->hold(mode);
  });
}
EMSCRIPTEN_KEEPALIVE const char* trainer_speed(double factor) {
  return failure_of([&] {
    if (trainer->body()) trainer->body()->set_speed(factor);
  });
}
/// A mode below 0: no gate.
EMSCRIPTEN_KEEPALIVE const char* trainer_gate(int mode, double phase) {
  return failure_of([&] {
    if (!trainer->body()) return;
    std::optional<xraycast::TrainerBody::Gate> gate;
    if (mode >= 0) gate = {static_cast<std::size_t>(mode), phase};
    trainer->body()->set_gate(gate);
  });
}
EMSCRIPTEN_KEEPALIVE void trainer_next_hub() { trainer->hold_next_hub(); }
EMSCRIPTEN_KEEPALIVE void trainer_valve() { trainer->toggle_valve(); }
EMSCRIPTEN_KEEPALIVE void trainer_inflate(std::size_t instrument, double bar) {
  trainer->inflate(instrument, bar);
}
EMSCRIPTEN_KEEPALIVE void trainer_draw_sheath(std::size_t instrument, double mm) {
  trainer->draw_sheath(instrument, mm);
}
EMSCRIPTEN_KEEPALIVE void trainer_detach(std::size_t instrument) { trainer->detach(instrument); }
EMSCRIPTEN_KEEPALIVE void trainer_particles(double mm) { trainer->mix_in({mm}); }
EMSCRIPTEN_KEEPALIVE const char* trainer_exchange(std::size_t instrument, std::size_t choice) {
  return failure_of([&] { trainer->exchange(instrument, choice); });
}

EMSCRIPTEN_KEEPALIVE void trainer_advance(int steps) { trainer->advance(steps); }

/// A step to poses of all hubs, whose numbers (see numbers_of) lie in the room; then it holds of each
/// instrument the tip in mm, and force in N and torque in N m at the hub.
EMSCRIPTEN_KEEPALIVE void trainer_follow() {
  const xraycast::Instruments& instruments = trainer->instruments();
  if (numbers.size() != xraycast::kPoseNumbers * instruments.count()) return;
  std::vector<xraycast::HubPose> poses;
  constexpr std::size_t kNumbers = xraycast::kPoseNumbers;
  for (std::size_t d = 0; d < instruments.count(); ++d)
    poses.push_back(xraycast::pose_of(std::span(numbers).subspan(kNumbers * d).first<kNumbers>()));
  trainer->follow(poses);
  numbers.clear();
  for (std::size_t d = 0; d < instruments.count(); ++d) {
    const glm::dvec3 tip_mm = instruments.tip(d).position_mm;
    const xraycast::HubLoad load = instruments.load(d);
    numbers.insert(numbers.end(), {tip_mm.x, tip_mm.y, tip_mm.z, load.force_N, load.torque_Nm});
  }
}

/// The report so far, see RunMonitor.
EMSCRIPTEN_KEEPALIVE const char* trainer_report(bool has_series) {
  text = trainer->monitor().json(has_series);
  return text.c_str();
}

/// The room takes what Trainer::take_steps gives. Returns how many numbers these are.
EMSCRIPTEN_KEEPALIVE std::size_t trainer_take_steps() {
  numbers = trainer->take_steps();
  return numbers.size();
}

/// The bytes of a message; see trainer_message_size.
EMSCRIPTEN_KEEPALIVE const char* trainer_message() {
  text = trainer->message();
  return text.data();
}
EMSCRIPTEN_KEEPALIVE std::size_t trainer_message_size() { return text.size(); }

}  // extern "C"
