// A catheter in a loop of one's own, 1000 times a second in a thread of its own, while the main thread draws
// it in a window. `example 3` closes the window after 3 s.
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <iostream>
#include <mutex>
#include <stop_token>
#include <thread>
#include <vector>
#include <xraycast/coaxial/instruments.hpp>
#include <xraycast/drawing/renderer.hpp>
#include <xraycast/phantom/phantom.hpp>
#include <xraycast/scene/catheter_surface.hpp>

#define GLFW_INCLUDE_NONE  // xraycast's headers have OpenGL from epoxy
#include <GLFW/glfw3.h>

using Clock = std::chrono::steady_clock;

// The newest state, for whoever draws.
struct Newest {
  std::mutex mutex;
  std::vector<glm::dvec3> nodes_mm;
  double force_N = 0;
};

struct Timing {
  std::atomic<long> steps{0}, late{0};
};

void run(const std::stop_token& stop, xraycast::Instruments& instruments, Newest& newest, Timing& timing) {
  const auto step =
      std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(instruments.step_s()));
  std::array<xraycast::HubPose, 1> hubs;
  auto due = Clock::now();
  while (!stop.stop_requested()) {
    // Here a haptic device's encoder is read ...
    hubs[0].insertion_mm = 150 * (1 - std::cos(0.8 * instruments.time_s()));
    hubs[0].rotation_rad = 2 * instruments.time_s();
    instruments.step(hubs);
    // ... and its motors are told this load. Nothing in this loop waits: what is being drawn is passed by.
    const xraycast::HubLoad load = instruments.load(0);
    if (const std::unique_lock lock(newest.mutex, std::try_to_lock); lock) {
      instruments.copy_nodes(0, newest.nodes_mm);
      newest.force_N = load.force_N;
    }
    due += step;
    ++timing.steps;
    if (Clock::now() > due) ++timing.late;
    std::this_thread::sleep_until(due);
  }
}

GLFWwindow* open_window() {
  if (!glfwInit()) return nullptr;
  glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 3);
  glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 3);
  glfwWindowHint(GLFW_OPENGL_PROFILE, GLFW_OPENGL_CORE_PROFILE);
  GLFWwindow* window = glfwCreateWindow(480, 640, "A catheter", nullptr, nullptr);
  if (window) glfwMakeContextCurrent(window);
  return window;
}

void draw(GLFWwindow* window, double seconds, const xraycast::VesselTree& tree,
          const xraycast::InstrumentModel& instrument, Newest& newest) {
  xraycast::Renderer renderer;  // in the window's context
  const std::array vessels{xraycast::Surface{.mesh = xraycast::tube_mesh(tree), .mu_per_mm = 0.01}};
  renderer.set_surfaces(vessels);
  std::vector<glm::dvec3> nodes_mm;
  while (!glfwWindowShouldClose(window) && glfwGetTime() < seconds) {
    {
      const std::lock_guard lock(newest.mutex);
      nodes_mm = newest.nodes_mm;
    }
    std::size_t index = vessels.size();
    for (const xraycast::Surface& part : xraycast::instrument_surfaces(nodes_mm, instrument))
      renderer.replace_surface(index++, part);
    xraycast::View view{.centre_mm = xraycast::centroid_mm(tree), .pixel_mm = 1.2};
    glfwGetFramebufferSize(window, &view.width, &view.height);
    renderer.draw(view, {.look = xraycast::Look::fluoro});
    glfwSwapBuffers(window);
    glfwPollEvents();
  }
}

int main(int argc, char** argv) {
  const xraycast::VesselTree tree(xraycast::make_phantom("thorax").vessel_branches(), "thorax");
  const xraycast::InstrumentModel cobra = xraycast::InstrumentModel::named("cobra-5f");
  xraycast::Instruments instruments(tree, {cobra}, xraycast::most_inferior_end(tree));
  GLFWwindow* window = open_window();
  if (!window) {
    std::cerr << "no window: is there a display with OpenGL 3.3?\n";
    return 1;
  }

  Newest newest;
  instruments.copy_nodes(0, newest.nodes_mm);
  Timing timing;
  {
    const std::jthread loop([&](const std::stop_token& stop) { run(stop, instruments, newest, timing); });
    draw(window, argc > 1 ? std::atof(argv[1]) : 1e6, tree, cobra, newest);
  }
  std::cout << timing.steps << " steps, " << timing.late << " of them late; at last the hub felt "
            << newest.force_N << " N\n";
  glfwTerminate();
}
