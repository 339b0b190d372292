#include "xraycast/serving/live_session.hpp"

#include "xraycast/base/error.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <thread>
#include <utility>

namespace xraycast {

void LiveSession::step(double passed_s) {
  obey();
  expose(passed_s);
  ++counts_.frames;
  const LivePicture* picture = is_outdated_ && (!drawn_from_ || is_watched()) ? draw() : nullptr;
  const LiveFrame frame{intervention_, pose_, picture, is_outdated_, intervention_.body()};
  for (LiveOutlet* outlet : outlets_) outlet->publish(frame);
}

/// The fluoroscope learns of pedal and time in every frame; a live frame between its pulses is none that is
/// drawn.
void LiveSession::expose(double passed_s) {
  intervention_.blur(painter_.blur(pose_));
  intervention_.count_generator(painter_.use());
  intervention_.update(pose_, passed_s);
  const bool is_live = intervention_.is_live();
  const bool is_new = std::exchange(exposures_, intervention_.exposures()) != intervention_.exposures();
  const bool is_due = painter_.is_due(is_live, intervention_.has_exposed(), passed_s);
  if (LiveBody* body = intervention_.body(); body && is_live && is_due) body->mark_exposure(body->time_s());
  if (is_new && (is_due || !is_live)) is_outdated_ = true;
}

const LivePicture* LiveSession::draw() {
  const LivePicture* picture = nullptr;
  try {
    picture = &painter_.draw(intervention_);
    if (drawn_from_ != intervention_.pose()) is_refusal_told_ = false;
    drawn_from_ = intervention_.pose();
  } catch (const InputError& error) {
    if (!drawn_from_ || *drawn_from_ == intervention_.pose()) throw;
    picture = draw_from_before(error.what());
  }
  is_outdated_ = false;
  ++counts_.pictures;
  return picture;
}

/// Where C-arm and table were when they could be drawn, and stay now.
const LivePicture* LiveSession::draw_from_before(const std::string& why) {
  if (!is_refusal_told_) log_("the C-arm stays where it was: " + why);
  is_refusal_told_ = true;
  pose_ = *drawn_from_;
  intervention_.expose_from(pose_);
  return &painter_.draw(intervention_);
}

void LiveSession::run(double rate_hz, const Progress& progress) {
  using Clock = std::chrono::steady_clock;
  const auto period = std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(1 / rate_hz));
  auto last = Clock::now(), next = last;
  while (!progress.cancelled()) {
    const auto now = Clock::now();
    step(std::chrono::duration<double>(now - last).count());
    last = now;
    next = std::max(next + period, Clock::now());
    std::this_thread::sleep_until(next);
  }
}

bool LiveSession::is_watched() const {
  return std::ranges::any_of(outlets_, [](const LiveOutlet* outlet) { return outlet->wants_pictures(); });
}

void LiveSession::obey() {
  LiveCommands all;
  for (LiveOutlet* outlet : outlets_) {
    const LiveCommands one = outlet->commands();
    all.pedal = all.pedal || one.pedal;
    all.injection_ml_s = std::max(all.injection_ml_s, one.injection_ml_s);
    all.insertion_mm_s += one.insertion_mm_s;
    all.rotation_rad_s += one.rotation_rad_s;
    if (one.c_arm) move_c_arm(*one.c_arm);
    change_body(one);
    treat(one);
    for (int i = 0; i < one.next_hubs; ++i) intervention_.hold_next_hub();
    for (int i = 0; i < one.valve_toggles; ++i) intervention_.toggle_valve();
  }
  intervention_.press_pedal(all.pedal);
  intervention_.run().inject(all.injection_ml_s);
  if (ManualDevice* hand = intervention_.manual()) hand->set_rates(all.insertion_mm_s, all.rotation_rad_s);
}

/// What an instrument has no balloon, sheath or coil for stays undone.
void LiveSession::treat(const LiveCommands& commands) {
  SimulatedRun& run = intervention_.run();
  if (commands.particles) run.mix_in(*commands.particles);
  for (std::size_t hub = 0; hub < run.now().count(); ++hub) {
    if (commands.balloons_bar[hub]) run.inflate(hub, *commands.balloons_bar[hub]);
    if (commands.sheaths_mm[hub]) run.draw_sheath(hub, *commands.sheaths_mm[hub]);
    if (commands.detaches[hub] && run.models()[hub].has_coils()) run.detach(hub);
  }
}

/// What cannot be is told once, and nothing else: a client may ask for anything.
void LiveSession::change_body(const LiveCommands& commands) {
  const auto attempt = [&](const auto& action) {
    try {
      LiveBody* const body = intervention_.body();
      if (!body) throw InputError("the body is still, or its motion is not known");
      action(*body);
    } catch (const InputError& error) {
      if (refused_ != error.what()) log_(fmt::format("the body goes on as it did: {}", error.what()));
      refused_ = error.what();
    }
  };
  if (!commands.body.is_empty()) attempt([&](LiveBody& body) { body.change(commands.body); });
  for (const std::string& text : commands.body_texts)
    attempt([&](LiveBody& body) { body.change(parse_body_changes(text)); });
}

void LiveSession::move_c_arm(const CArmRequest& request) {
  pose_.lao_rad = request.lao_rad;
  pose_.rotate(0);  // within half a turn
  pose_.cranial_rad = request.cranial_rad;
  pose_.tilt(0);  // within its limits
  if (request.centre_z_mm) pose_.table_mm = *request.centre_z_mm - bounds_.centre_mm.z;
  pose_.travel(0, bounds_);
  if (request.zoom) pose_.zoom = *request.zoom;
  pose_.magnify(1);
}

}  // namespace xraycast
