#pragma once

struct GLFWwindow;

namespace xraycast {

/// A window with OpenGL 3.3 core, current on the thread that made it, with Dear ImGui. At most one exists at
/// a time.
class Window {
 public:
  /// Throws Error, naming the command that needs neither, when there is no display or no OpenGL 3.3 on it.
  Window();
  ~Window();
  Window(const Window&) = delete;
  Window& operator=(const Window&) = delete;

  GLFWwindow* handle() const { return window_; }

  /// Call after setting other callbacks: Dear ImGui chains to them.
  void attach_gui();

  /// The framebuffer's size in pixels; 0 x 0 while the window is minimised.
  struct Size {
    int width = 0, height = 0;
  };
  Size framebuffer() const;

  void begin_gui();  ///< the controls of a frame follow
  void end_gui();    ///< draws them, and shows the frame

 private:
  GLFWwindow* window_ = nullptr;
};

}  // namespace xraycast
