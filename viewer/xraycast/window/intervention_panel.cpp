#include "xraycast/window/intervention_panel.hpp"

#include "xraycast/base/negative_zero.hpp"
#include "xraycast/contrast_agent/agent_outlet.hpp"
#include "xraycast/haptics/hand_rates.hpp"
#include "xraycast/window/hub_input.hpp"
#include "xraycast/window/operator_screen.hpp"
#include "xraycast/window/viewer_input.hpp"

#include <fmt/format.h>

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <algorithm>
#include <cmath>
#include <imgui.h>
#include <numbers>
#include <string>
#include <vector>

namespace xraycast {

namespace {

constexpr double kRadians = std::numbers::pi / 180;

/// With Control held, the mouse moves the hub.
void drag_hub(ManualDevice& hand) {
  const ImGuiIO& io = ImGui::GetIO();
  if (io.WantCaptureMouse || !io.KeyCtrl) return;
  constexpr double kPush_mm_per_pixel = 0.5, kRotate_deg_per_pixel = 1, kPush_mm_per_notch = 3;
  double push_mm = kPush_mm_per_notch * io.MouseWheel, rotate_deg = 0;
  if (is_dragged(ImGuiMouseButton_Left)) {
    push_mm -= kPush_mm_per_pixel * io.MouseDelta.y;
    rotate_deg += kRotate_deg_per_pixel * io.MouseDelta.x;
  }
  hand.move_by(push_mm, kRadians * rotate_deg);
}

void write_wrapped(const std::string& text) { ImGui::TextWrapped("%s", text.c_str()); }

/// A value of the last seconds at even times, whenever frames were drawn.
template <typename Value>
std::vector<float> over_time(const SimulatedRun& run, const Value& value) {
  constexpr int kSamples = 240;
  const auto& loads = run.loads();
  std::vector<float> values;
  if (loads.empty()) return values;
  const double from_s = loads.front().time_s, to_s = loads.back().time_s;
  std::size_t next = 0;
  for (int i = 0; i < kSamples; ++i) {
    const double time_s = std::lerp(from_s, to_s, static_cast<double>(i) / (kSamples - 1));
    while (next + 1 < loads.size() && loads[next].time_s < time_s) ++next;
    values.push_back(static_cast<float>(value(loads[next])));
  }
  return values;
}

/// Values of the last seconds under their name and what is read of them.
void draw_chart(const char* name, const std::string& reading, const std::vector<float>& values, float least,
                float most, const ImVec2& size) {
  ImGui::BeginGroup();
  ImGui::AlignTextToFramePadding();
  ImGui::TextDisabled("%s", name);
  ImGui::SameLine();
  ImGui::TextUnformatted(reading.c_str());
  ImGui::PlotLines(fmt::format("##{}", name).c_str(), values.data(), static_cast<int>(values.size()), 0,
                   nullptr, least, most, size);
  ImGui::EndGroup();
}

void load_chart(const char* name, const SimulatedRun& run, std::size_t hub, double HubLoad::*load,
                double scale, const char* unit, float width) {
  const std::vector<float> values =
      over_time(run, [&](const SimulatedRun::Load& at) { return scale * (at.hubs[hub].*load); });
  float largest = 0.1f;
  for (const float value : values) largest = std::max(largest, std::abs(value));
  draw_chart(name, fmt::format("{:+.2f} {}", no_negative_zero(values.empty() ? 0 : values.back(), 2), unit),
             values, -largest, largest, {width, 4 * ImGui::GetFontSize()});
}

/// Of the blood at an instrument's tip.
void pressure_chart(const SimulatedRun& run, std::size_t instrument) {
  constexpr float kMost_mmHg = 160, kRows = 3;
  const std::vector<float> values =
      over_time(run, [&](const SimulatedRun::Load& at) { return at.tips_mmHg[instrument]; });
  float most_mmHg = kMost_mmHg;
  for (const float pressure : values) most_mmHg = std::max(most_mmHg, pressure);
  draw_chart("at the tip", in_words(run.pressures().tip(instrument)), values, 0, most_mmHg,
             {ImGui::GetContentRegionAvail().x, kRows * ImGui::GetFontSize()});
}

/// Over a network every hub is moved, and one leads while the valve is locked.
const char* note_on_hand(const Intervention& intervention) {
  const SimulatedRun& run = intervention.run();
  if (!run.has_valve()) return "instrument";
  if (intervention.manual()) return "in the hand (Tab)";
  return run.is_valve_locked() ? "leads (Tab)" : "next: Tab";
}

/// What the instrument in the hand can be exchanged for.
void choose_instrument(Intervention& intervention, std::size_t number) {
  const std::string present = intervention.run().models()[number].name();
  ImGui::SetNextItemWidth(12 * ImGui::GetFontSize());
  if (ImGui::BeginCombo(note_on_hand(intervention), present.c_str(), ImGuiComboFlags_HeightLargest)) {
    for (const InstrumentModel& choice : intervention.choices()) {
      const bool is_present = choice.name() == present;
      if (ImGui::Selectable(choice.name().c_str(), is_present) && !is_present)
        intervention.exchange(number, choice);
    }
    ImGui::EndCombo();
  }
  if (const std::string note = intervention.note_on_exchange(number); !note.empty()) write_wrapped(note);
}

/// How far its balloon is to be filled, and is.
void fill_balloon(Intervention& intervention, std::size_t number) {
  const InstrumentModel& model = intervention.run().models()[number];
  if (!model.balloon()) return;
  const InstrumentSnapshot& instrument = intervention.run().now().instrument(number);
  auto bar = static_cast<float>(intervention.run().inflation_bar(number));
  ImGui::SetNextItemWidth(8 * ImGui::GetFontSize());
  if (ImGui::SliderFloat("balloon, bar", &bar, 0, static_cast<float>(model.max_inflation_bar()), "%.1f"))
    intervention.run().inflate(number, bar);
  ImGui::SameLine();
  if (ImGui::Button("Fold")) intervention.run().inflate(number, 0);
  const double diameter_mm = 2 * model.balloon_radius_mm(instrument.balloon_bar);
  if (instrument.balloon_bar > 0)
    write_wrapped(fmt::format("filled to {:.1f} bar: {:.2f} mm", instrument.balloon_bar, diameter_mm));
  else
    write_wrapped(bar > 0 ? "folded: advance it out of what is around it" : "folded");
}

/// How far its stent's sheath is to be drawn back, which does not go back over it.
void draw_sheath(Intervention& intervention, std::size_t number) {
  const InstrumentModel& model = intervention.run().models()[number];
  if (!model.has_sheath()) return;
  const InstrumentSnapshot& instrument = intervention.run().now().instrument(number);
  auto mm = static_cast<float>(intervention.run().sheath_mm(number));
  const auto drawn_mm = static_cast<float>(instrument.pose.release_mm);
  ImGui::SetNextItemWidth(8 * ImGui::GetFontSize());
  if (ImGui::SliderFloat("sheath drawn back, mm", &mm, 0, static_cast<float>(model.max_release_mm()), "%.1f"))
    intervention.run().draw_sheath(number, std::max(mm, drawn_mm));
  const int rings = model.stent()->rings, free_rings = rings - instrument.carried_rings;
  if (free_rings == 0 && drawn_mm == static_cast<float>(model.max_release_mm()))
    write_wrapped("the stent is not free: advance it out of what is around it");
  else
    write_wrapped(fmt::format("{} of {} rings of the stent are free", free_rings, rings));
}

/// The coil on a wire, and the sac that it lies in.
void detach_coil(Intervention& intervention, std::size_t number) {
  const SimulatedRun& run = intervention.run();
  if (!run.models()[number].has_coils()) return;
  constexpr double kPercent = 100;
  if (const std::optional<PushedCoil>& coil = run.now().instrument(number).coil) {
    ImGui::BeginDisabled(!coil->can_be_detached());
    if (ImGui::Button("Detach coil")) intervention.run().detach(number);
    ImGui::EndDisabled();
    write_wrapped(fmt::format("coil of {:g} mm by {:g} mm: {:.0f} mm in the aneurysm{}", coil->model.loop_mm,
                              coil->model.length_mm, coil->laid_mm,
                              coil->is_outside() ? "; lead the tip around it into one" : ""));
  } else {
    write_wrapped("no coil: draw the wire back to 0 for the next one");
  }
  if (!run.now().coiled) return;
  for (const CoiledSac& sac : *run.now().coiled)
    if (sac.packing > 0) write_wrapped(fmt::format("packing density {:.1f} %", kPercent * sac.packing));
}

void show_instrument(Intervention& intervention, std::size_t number) {
  const SimulatedRun& run = intervention.run();
  const InstrumentSnapshot& instrument = run.now().instrument(number);
  ImGui::PushID(static_cast<int>(number));
  if (number == run.held_hub() && !intervention.run().device().is_rigid()) {
    choose_instrument(intervention, number);
  } else {
    ImGui::AlignTextToFramePadding();
    write_wrapped(run.models()[number].name());
  }
  write_wrapped(fmt::format("inserted {:.1f} mm, rotated {:.0f} deg",
                            no_negative_zero(instrument.pose.insertion_mm, 1),
                            no_negative_zero(instrument.pose.rotation_rad / kRadians, 0)));
  write_wrapped(fmt::format("tip: {}, at {:.0f} mm", run.tree().title(instrument.tip.branch),
                            no_negative_zero(instrument.tip.arc_length_mm, 0)));
  fill_balloon(intervention, number);
  draw_sheath(intervention, number);
  detach_coil(intervention, number);
  show_loads(run, number);
  ImGui::PopID();
}

/// What is mixed into the contrast agent, and where it has gone.
void choose_particles(Intervention& intervention) {
  constexpr std::array<double, 5> kChoices_mm{0, 0.3, 0.5, 0.7, 0.9};
  const auto words = [](double mm) {
    return mm > 0 ? fmt::format("particles of {:g} mm", mm) : std::string("no particles");
  };
  const double present_mm = intervention.run().particles().diameter_mm;
  ImGui::SetNextItemWidth(12 * ImGui::GetFontSize());
  if (ImGui::BeginCombo("in the agent", words(present_mm).c_str())) {
    for (const double mm : kChoices_mm)
      if (ImGui::Selectable(words(mm).c_str(), mm == present_mm)) intervention.run().mix_in({mm});
    ImGui::EndCombo();
  }
  constexpr std::size_t kMostShown = 3;
  const double lumen_mm = intervention.run().now().agent_lumen_mm;
  if (present_mm >= lumen_mm && lumen_mm > 0 && present_mm > 0)
    write_wrapped(fmt::format("they do not pass the lumen of {:.2f} mm", lumen_mm));
  for (const Embolised& embolised : most_first(intervention.run().embolised(), kMostShown))
    write_wrapped(in_words(embolised));
}

/// Where a fluoroscope is on, its panel has its own fluoroscopy time, road map and pedal.
void show_usage(const Viewer& viewer, Intervention& intervention) {
  const SimulatedRun& run = intervention.run();
  if (viewer.console()) {
    write_wrapped(fmt::format("contrast agent {:.0f} ml", run.injected_ml()));
  } else {
    const auto minutes = static_cast<int>(intervention.fluoroscopy_s() / 60);
    write_wrapped(fmt::format("fluoro time {}:{:04.1f} min, contrast agent {:.0f} ml", minutes,
                              intervention.fluoroscopy_s() - 60 * minutes, run.injected_ml()));
  }
  choose_particles(intervention);
  if (!run.now().agent_outlet)
    write_wrapped(fmt::format("no contrast agent: {}", reason_for_no_outlet(run.models())));
  if (viewer.console()) return;
  write_wrapped(intervention.is_live() ? "X-rays on" : "last image hold: hold X for fluoroscopy");
  bool shows = intervention.has_road_map();
  if (ImGui::Checkbox("road map", &shows)) intervention.show_road_map(shows);
}

}  // namespace

/// One above the other, or side by side where there are more instruments or traces of a body.
void show_loads(const SimulatedRun& run, std::size_t hub) {
  const float row = ImGui::GetContentRegionAvail().x, gap = ImGui::GetStyle().ItemSpacing.x;
  const float width = (row - gap) / 2, top = ImGui::GetCursorPosY();
  load_chart("force", run, hub, &HubLoad::force_N, 1, "N", width);
  ImGui::SameLine();
  ImGui::SetCursorPosY(top);
  load_chart("torque", run, hub, &HubLoad::torque_Nm, 1000, "N mm", width);
  pressure_chart(run, hub);
}

void handle_held_input(Viewer& viewer, GLFWwindow* window) {
  const bool types = ImGui::GetIO().WantTextInput;
  const HubInput keys = held_keys([&](int key) { return glfwGetKey(window, key) == GLFW_PRESS && !types; });
  const auto pad_state = connected_pad();
  const HubInput pad = pad_state ? held_pad(*pad_state) : HubInput{};
  viewer.press_pedal(keys.pedal || pad.pedal);
  Intervention* intervention = viewer.intervention();
  if (!intervention) return;
  intervention->run().inject(keys.injects || pad.injects ? kInjection_ml_s : 0);

  ManualDevice* hand = intervention->manual();
  if (!hand) return;
  if (intervention->haptic() == "mouse") drag_hub(*hand);
  const HubInput& held = intervention->haptic() == "gamepad" && pad_state ? pad : keys;
  hand->set_rates(held.insertion_mm_s, held.rotation_rad_s);
}

void draw_intervention_panel(Viewer& viewer) {
  Intervention* intervention = viewer.intervention();
  if (!intervention) return;
  const SimulatedRun& run = intervention->run();
  const CatheterSnapshot& now = run.now();
  const float width = monitor_width();
  const ImVec2 size = ImGui::GetIO().DisplaySize;
  const int height = viewer.panes(static_cast<int>(size.x), static_cast<int>(size.y)).front().height;
  ImGui::SetNextWindowPos({size.x - width, 0}, ImGuiCond_FirstUseEver);
  ImGui::SetNextWindowSizeConstraints(
      {width, 0}, {width, std::max(10 * ImGui::GetFontSize(), static_cast<float>(height))});
  ImGui::Begin("catheter", nullptr, ImGuiWindowFlags_AlwaysAutoResize);
  write_wrapped(fmt::format("hub input: {}", intervention->run().device().status()));
  for (std::size_t d = 0; d < now.count(); ++d) show_instrument(*intervention, d);
  if (run.has_valve()) {
    bool is_locked = run.is_valve_locked();
    if (ImGui::Checkbox("valve locked", &is_locked)) intervention->run().lock_valve(is_locked);
  }
  show_usage(viewer, *intervention);
  const LoopTiming& timing = now.timing;
  write_wrapped(fmt::format("step {:.2f} ms, p99.9 {:.2f} ms, {:.2f} % late", timing.mean_ms, timing.p999_ms,
                            100.0 * static_cast<double>(timing.missed) /
                                static_cast<double>(std::max<std::int64_t>(1, timing.steps))));
  if (ImGui::Button("Restart")) viewer.restart_run();
  ImGui::SameLine();
  // A restart has made another run.
  if (ImGui::Button(intervention->run().is_recording() ? "Stop recording" : "Record"))
    viewer.toggle_recording();
  ImGui::SameLine();
  if (ImGui::Button("Replay")) viewer.replay();
  ImGui::End();
}

}  // namespace xraycast
