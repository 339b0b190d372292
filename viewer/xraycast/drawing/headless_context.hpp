#pragma once

#include <string>

namespace xraycast {

/// An OpenGL 3.3 core context without a display or window, through EGL: on the device that the environment
/// variable XRAYCAST_GL_DEVICE selects by number or part of its name, otherwise on the first GPU that
/// supports it, or else on Mesa's surfaceless platform, which draws in software. Current on the thread that
/// created it for its lifetime. At most one exists at a time.
class HeadlessContext {
 public:
  /// Throws Error, saying what to install, when there is no such OpenGL, and InputError, naming the available
  /// devices, when none matches XRAYCAST_GL_DEVICE.
  HeadlessContext();
  ~HeadlessContext();
  HeadlessContext(const HeadlessContext&) = delete;
  HeadlessContext& operator=(const HeadlessContext&) = delete;

 private:
  void* display_;
  void* context_ = nullptr;
};

/// The name of the current context's renderer, such as `llvmpipe (LLVM 15.0.6, 256 bits)`.
std::string gl_device_name();

}  // namespace xraycast
