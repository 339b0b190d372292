#pragma once

#include <string>

namespace xraycast {

/// An OpenGL 3.3 core context without a display or window, through EGL: on what the environment's
/// XRAYCAST_GL_DEVICE says, by number or part of its name; without that on the first GPU that has one, or
/// else on Mesa's surfaceless platform, which draws in software. Current on the thread that made it for as
/// long as it lives. There is one at a time.
class HeadlessContext {
 public:
  /// Throws Error, saying what to install, when there is no such OpenGL, and InputError, naming what there
  /// is, when none fits XRAYCAST_GL_DEVICE.
  HeadlessContext();
  ~HeadlessContext();
  HeadlessContext(const HeadlessContext&) = delete;
  HeadlessContext& operator=(const HeadlessContext&) = delete;

 private:
  void* display_;
  void* context_ = nullptr;
};

/// The name of what draws for the current context, such as `llvmpipe (LLVM 15.0.6, 256 bits)`.
std::string gl_device_name();

}  // namespace xraycast
