// The viewer opened and closed many times on a virtual display, and a command that fails in it.
#include "support/temporary_folder.hpp"
#include "xraycast/casting/body_map.hpp"
#include "xraycast/drawing/gl.hpp"
#include "xraycast/window/viewer.hpp"
#include "xraycast/window/viewer_panel.hpp"
#include "xraycast/window/window.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <stdexcept>
#include <string>
#include <sys/wait.h>
#include <thread>
#include <unistd.h>

namespace xraycast::window_cycles_test {
namespace {

namespace fs = std::filesystem;

/// Xvfb, as this process' DISPLAY.
class VirtualDisplay {
 public:
  VirtualDisplay() {
    int ends[2];
    if (pipe(ends) != 0) throw std::runtime_error("no pipe");
    process_ = fork();
    if (process_ == 0) {
      const std::string number = std::to_string(ends[1]);
      execlp("Xvfb", "Xvfb", "-displayfd", number.c_str(), "-noreset", "-nolisten", "tcp", nullptr);
      _exit(127);
    }
    close(ends[1]);
    std::string name = ":";
    for (char c = 0; read(ends[0], &c, 1) == 1 && c != '\n';) name += c;
    close(ends[0]);
    setenv("DISPLAY", name.c_str(), 1);
  }
  ~VirtualDisplay() {
    kill(process_, SIGTERM);
    waitpid(process_, nullptr, 0);
  }
  VirtualDisplay(const VirtualDisplay&) = delete;
  VirtualDisplay& operator=(const VirtualDisplay&) = delete;

 private:
  pid_t process_;
};

fs::path write_small_map() {
  BodyMap map;
  map.geometry.width = 36;
  map.geometry.height = 40;
  map.geometry.top_mm = 20;
  map.geometry.radii_mm = {0, 50, 100};
  map.geometry.centre_mm = {{0, 0}};
  map.tau.assign(2 * map.layer_size(), 0.5f);
  const fs::path path = fs::temp_directory_path() / "xraycast-window-cycles.exr";
  write_body_map(map, path);
  return path;
}

ViewSession session_of(const fs::path& map) {
  ViewSession session;
  session.map = map;
  return session;
}

/// A viewer of a map in a window.
struct Shown {
  Window window;
  Viewer viewer;
  ViewerPanel panel;

  explicit Shown(const fs::path& map) : viewer(session_of(map), "", [] {}) { window.attach_gui(); }

  /// Draws until `holds`, for 20 s at most; returns whether it holds.
  bool draw_until(const std::function<bool()>& holds) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(20);
    bool held = false;
    while (!held && std::chrono::steady_clock::now() < end) {
      held = holds();
      const auto [width, height] = window.framebuffer();
      viewer.draw(width, height);
      window.begin_gui();
      panel.draw(viewer);
      window.end_gui();
    }
    return held;
  }
};

/// Opens a window, draws until the map is there and its picture has been shown, and closes it.
void open_and_close(const fs::path& map) {
  Shown shown(map);
  ASSERT_TRUE(shown.draw_until([&] { return shown.viewer.map() != nullptr; })) << shown.viewer.message();
}

/// Memory that this process holds.
std::size_t resident_B() {
  std::ifstream file("/proc/self/statm");
  std::size_t whole = 0, resident = 0;
  file >> whole >> resident;
  return resident * static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
}

TEST(Window, OpensAndClosesTwoHundredTimesAndLeavesNothing) {
  const VirtualDisplay display;
  const fs::path map = write_small_map();
  constexpr int kCycles = 200, kWarmUp = 20;
  std::size_t before_B = 0;
  for (int cycle = 0; cycle < kCycles; ++cycle) {
    if (cycle == kWarmUp) before_B = resident_B();
    open_and_close(map);
    ASSERT_EQ(gl::objects_alive(), 0) << cycle;
    if (HasFatalFailure()) break;
  }
  fs::remove(map);
  // A window's targets alone take 10 MB, a shader's machine code 50 KB: 180 windows that leaked either would
  // hold more than this. What drivers and allocators keep for themselves stays below.
  EXPECT_LT(resident_B(), before_B + std::size_t{40'000'000});
}

TEST(Window, EndsACineThatCannotBeWritten) {
  const VirtualDisplay display;
  const fs::path map = write_small_map(), before = fs::current_path();
  const TemporaryFolder folder;
  fs::current_path(folder.path());
  {
    Shown shown(map);
    ASSERT_TRUE(shown.draw_until([&] { return shown.viewer.map() != nullptr; })) << shown.viewer.message();
    shown.viewer.save_cine();
    ASSERT_TRUE(shown.viewer.is_animating()) << shown.viewer.message();
    fs::remove_all("xraycast-cine-001");
    std::ofstream("xraycast-cine-001") << "a file where the folder was";
    EXPECT_TRUE(shown.draw_until([&] { return !shown.viewer.is_animating(); }));
    EXPECT_THAT(shown.viewer.message(), testing::HasSubstr("xraycast-cine-001"));
  }
  fs::current_path(before);
  fs::remove(map);
}

}  // namespace
}  // namespace xraycast::window_cycles_test
