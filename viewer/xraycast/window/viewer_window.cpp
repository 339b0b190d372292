#include "xraycast/window/viewer_window.hpp"

#include "xraycast/base/atomic_file.hpp"
#include "xraycast/reports/run_comparison.hpp"
#include "xraycast/window/body_panel.hpp"
#include "xraycast/window/exposure_panel.hpp"
#include "xraycast/window/intervention_panel.hpp"
#include "xraycast/window/operator_screen.hpp"
#include "xraycast/window/viewer.hpp"
#include "xraycast/window/viewer_input.hpp"
#include "xraycast/window/viewer_panel.hpp"
#include "xraycast/window/window.hpp"

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <filesystem>
#include <imgui.h>
#include <vector>

namespace xraycast {
namespace {

/// The user data of GLFW's callbacks.
struct Desk {
  Viewer viewer;
  ViewerPanel panel;
};

Desk& desk_of(GLFWwindow* window) { return *static_cast<Desk*>(glfwGetWindowUserPointer(window)); }

void set_callbacks(GLFWwindow* window, Desk& desk) {
  glfwSetWindowUserPointer(window, &desk);
  glfwSetDropCallback(window, [](GLFWwindow* w, int count, const char** paths) {
    desk_of(w).viewer.open(std::vector<std::filesystem::path>(paths, paths + count));
  });
  glfwSetKeyCallback(window, [](GLFWwindow* w, int key, int, int action, int mods) {
    if (action != GLFW_PRESS || desk_of(w).panel.takes_key(key)) return;
    desk_of(w).viewer.shows_first_steps = false;
    if (handle_key(desk_of(w).viewer, key, mods)) desk_of(w).panel.ask_for_file();
  });
}

/// Waits for the next event. Without one, progress and what Dear ImGui settles late are drawn a few times a
/// second, and a catheter at a fluoroscope's frame rate.
void wait_for_events(const Viewer& viewer) {
  constexpr double kProgress_s = 0.05, kIdle_s = 0.25, kFluoroscope_s = 1.0 / 30, kHeld_s = 0.1;
  if (viewer.is_animating())
    glfwPollEvents();
  else if (viewer.intervention() || viewer.console() || viewer.is_moving())
    glfwWaitEventsTimeout(viewer.pedal() || viewer.is_moving() ? kFluoroscope_s : kHeld_s);
  else
    glfwWaitEventsTimeout(viewer.status() ? kProgress_s : kIdle_s);
}

}  // namespace

void run_viewer(const ViewSession& session, const std::string& device, const Progress& progress,
                const std::optional<Intervention::Options>& simulation,
                const std::optional<FluoroscopyOptions>& fluoroscopy, const BodyRequest& body,
                const std::optional<MaskPhase>& mask_phase, const std::filesystem::path& report) {
  Window window;
  Desk desk{Viewer(
                session, device, [] { glfwPostEmptyEvent(); }, body),
            {}};
  if (simulation) desk.viewer.simulate(*simulation);
  desk.viewer.keep_report(report);
  desk.viewer.shows_panels = !simulation;
  desk.viewer.shows_first_steps = simulation.has_value();
  if (fluoroscopy) desk.viewer.use_fluoroscope(*fluoroscopy);
  desk.viewer.match_masks(mask_phase);
  set_callbacks(window.handle(), desk);
  glfwSetInputMode(window.handle(), GLFW_STICKY_KEYS, GLFW_TRUE);  // a tap between two frames counts
  window.attach_gui();
  window.begin_gui();
  draw_operator_screen(desk.viewer);  // the first picture needs to know its room
  window.end_gui();
  while (!glfwWindowShouldClose(window.handle()) && !progress.cancelled()) {
    wait_for_events(desk.viewer);
    const auto [width, height] = window.framebuffer();
    desk.viewer.draw(width, height);
    window.begin_gui();
    handle_mouse(desk.viewer);
    handle_held_input(desk.viewer, window.handle());
    desk.panel.draw(desk.viewer);
    if (desk.viewer.shows_panels) {
      draw_intervention_panel(desk.viewer);
      draw_exposure_panel(desk.viewer);
      draw_body_panel(desk.viewer);
    }
    draw_operator_screen(desk.viewer);
    window.end_gui();
  }
  keep_outputs();
  if (!report.empty() && desk.viewer.intervention())
    write_report(report, desk.viewer.intervention()->run().monitor().json(true));
}

}  // namespace xraycast
