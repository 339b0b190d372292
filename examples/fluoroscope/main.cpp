// A live fluoroscope in a window of one's own: xraycast draws and exposes in the window's OpenGL context, and
// the program shows the pulses as it likes. `example 3` closes the window after 3 s.
#include <array>
#include <cstdlib>
#include <epoxy/gl.h>
#include <iostream>
#include <memory>
#include <span>
#include <xraycast/acquisition/map_acquisition.hpp>
#include <xraycast/fluoroscope/fluoroscope_request.hpp>
#include <xraycast/phantom/phantom.hpp>
#include <xraycast/requests/cast_request.hpp>
#include <xraycast/scene/catheter_surface.hpp>
#include <xraycast/simulation/simulation_loop.hpp>

#define GLFW_INCLUDE_NONE  // xraycast's headers have OpenGL from epoxy
#include <GLFW/glfw3.h>

// A window with a texture that fills it.
class Window {
 public:
  Window() {
    if (!glfwInit()) return;
    glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 3);
    glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 3);
    glfwWindowHint(GLFW_OPENGL_PROFILE, GLFW_OPENGL_CORE_PROFILE);
    window_ = glfwCreateWindow(512, 512, "Fluoroscopy", nullptr, nullptr);
    if (window_) glfwMakeContextCurrent(window_);
  }
  ~Window() { glfwTerminate(); }
  bool is_open() const { return window_ && !glfwWindowShouldClose(window_); }

  // 8-bit RGB, row 0 on top.
  void show(std::span<const unsigned char> rgb, int width, int height) {
    if (texture_ == 0) glGenTextures(1, &texture_);
    if (framebuffer_ == 0) glGenFramebuffers(1, &framebuffer_);
    glBindTexture(GL_TEXTURE_2D, texture_);
    glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
    glTexImage2D(GL_TEXTURE_2D, 0, GL_RGB8, width, height, 0, GL_RGB, GL_UNSIGNED_BYTE, rgb.data());
    glBindFramebuffer(GL_READ_FRAMEBUFFER, framebuffer_);
    glFramebufferTexture2D(GL_READ_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_TEXTURE_2D, texture_, 0);
    glBindFramebuffer(GL_DRAW_FRAMEBUFFER, 0);
    int right = 0, top = 0;
    glfwGetFramebufferSize(window_, &right, &top);
    glBlitFramebuffer(0, height, width, 0, 0, 0, right, top, GL_COLOR_BUFFER_BIT, GL_LINEAR);
    glfwSwapBuffers(window_);
  }

 private:
  GLFWwindow* window_ = nullptr;
  GLuint texture_ = 0, framebuffer_ = 0;
};

std::shared_ptr<const xraycast::BodyMap> map_of(const xraycast::Phantom& phantom) {
  xraycast::ComputeDevice device;
  xraycast::Progress progress;
  const xraycast::Volume volume = xraycast::generate(phantom, device, progress);
  const xraycast::CastRequest request{.layers = 16};
  xraycast::OutlineFinder body = xraycast::outline_finder(request, volume.geometry());
  body.add(volume.hu());
  const xraycast::SpectralScan scan{xraycast::upload(device, volume), {}};
  return std::make_shared<xraycast::BodyMap>(xraycast::cast(request, scan, body, {}, progress).map);
}

int main(int argc, char** argv) {
  const double seconds = argc > 1 ? std::atof(argv[1]) : 1e6;
  const xraycast::Phantom thorax = xraycast::make_phantom("thorax", {.size = xraycast::Index3(128, 128, 96)});
  const auto map = map_of(thorax);
  const xraycast::VesselTree tree(thorax.vessel_branches(), "thorax");
  const xraycast::InstrumentModel cobra = xraycast::InstrumentModel::named("cobra-5f");

  Window window;
  if (!window.is_open()) {
    std::cerr << "no window: is there a display with OpenGL 3.3?\n";
    return 1;
  }
  const xraycast::FluoroscopyOptions fluoroscopy = xraycast::options_of({.dose = "low"});
  // 512 x 512 pixels of 0.6 mm on the detector, the right iliac artery in the middle.
  const xraycast::View view{.cone = xraycast::Cone{700, 1100},
                            .centre_mm = {-60, -50, -290},
                            .width = 512,
                            .height = 512,
                            .pixel_mm = 0.6};
  xraycast::Renderer renderer;  // in the context that is current
  renderer.set_map(map);
  xraycast::MapAcquisition fluoroscope(renderer, {.map = map}, {.acquisition = {.fluoroscope = fluoroscopy}},
                                       view);

  // The catheter moves in a thread of its own, 1000 steps a second; here it is pushed at 60 mm/s.
  std::array<xraycast::HubPose, 1> hubs;
  xraycast::SimulationLoop loop(
      std::make_unique<xraycast::Instruments>(tree, std::vector{cobra}, xraycast::most_inferior_end(tree)),
      [&hubs](auto, auto, double step_s) {
        hubs[0].insertion_mm += 60 * step_s;
        return std::span<const xraycast::HubPose>(hubs);
      });

  int pulses = 0;
  while (window.is_open() && glfwGetTime() < seconds) {
    std::size_t index = 0;
    for (const xraycast::Surface& part : xraycast::instrument_surfaces(loop.snapshot().nodes_mm, cobra))
      renderer.replace_surface(index++, part);
    window.show(fluoroscope.picture(view), view.width, view.height);
    ++pulses;
    do {
      glfwWaitEventsTimeout(0.001);
    } while (window.is_open() && glfwGetTime() < pulses / fluoroscopy.pulses_per_s);
  }
  const auto record = fluoroscope.acquisition().record();
  std::cout << pulses << " pulses, " << record->dose.dap_Gycm2 << " Gy cm2; the tip is at "
            << loop.snapshot().tip.position_mm.z << " mm\n";
}
