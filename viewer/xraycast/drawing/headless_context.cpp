#include "xraycast/drawing/headless_context.hpp"

#include "xraycast/base/device_choice.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/memory_limit.hpp"

#include <array>
#include <cstdlib>
#include <dlfcn.h>
#include <epoxy/egl.h>
#include <epoxy/gl.h>
#include <string_view>
#include <vector>

namespace xraycast {
namespace {

// Measured with Mesa 22.3's software rasterizer, which compiles shaders by LLVM, with a third more.
constexpr MemoryNeed kDriver{300 << 20, 120 << 20};

constexpr const char* kAdvice =
    "install libegl1, libopengl0 and libgl1-mesa-dri, which draw in software where there is no GPU";

/// libepoxy, which opens these when they are first needed, ends the process where they are missing.
void require_libraries() {
  if (!dlopen("libEGL.so.1", RTLD_LAZY)) throw Error("libEGL.so.1 is missing; {}", kAdvice);
  if (!dlopen("libOpenGL.so.0", RTLD_LAZY) && !dlopen("libGL.so.1", RTLD_LAZY))
    throw Error("libOpenGL.so.0 is missing; {}", kAdvice);
}

bool has_client_extension(const char* name) { return epoxy_has_egl_extension(EGL_NO_DISPLAY, name); }

bool draws_in_software(EGLDeviceEXT device) {
  const char* extensions = eglQueryDeviceStringEXT(device, EGL_EXTENSIONS);
  return extensions &&
         std::string_view(extensions).find("EGL_MESA_device_software") != std::string_view::npos;
}

/// The displays that need no screen, the best first: every GPU, then Mesa's surfaceless platform.
std::vector<EGLDisplay> displays() {
  std::vector<EGLDisplay> found;
  if (has_client_extension("EGL_EXT_platform_device") && has_client_extension("EGL_EXT_device_enumeration") &&
      has_client_extension("EGL_EXT_device_query")) {
    std::array<EGLDeviceEXT, 16> devices{};
    EGLint count = 0;
    eglQueryDevicesEXT(static_cast<EGLint>(devices.size()), devices.data(), &count);
    for (EGLint i = 0; i < count; ++i)
      if (!draws_in_software(devices[i]))
        found.push_back(eglGetPlatformDisplayEXT(EGL_PLATFORM_DEVICE_EXT, devices[i], nullptr));
  }
  if (has_client_extension("EGL_MESA_platform_surfaceless"))
    found.push_back(eglGetPlatformDisplayEXT(EGL_PLATFORM_SURFACELESS_MESA, nullptr, nullptr));
  return found;
}

/// A current context on the display, or none.
EGLContext context_on(EGLDisplay display) {
  if (!display || !eglInitialize(display, nullptr, nullptr)) return EGL_NO_CONTEXT;
  eglBindAPI(EGL_OPENGL_API);
  constexpr EGLint kAttributes[] = {EGL_CONTEXT_MAJOR_VERSION,
                                    3,
                                    EGL_CONTEXT_MINOR_VERSION,
                                    3,
                                    EGL_CONTEXT_OPENGL_PROFILE_MASK,
                                    EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT,
                                    EGL_NONE};
  const EGLContext context = eglCreateContext(display, EGL_NO_CONFIG_KHR, EGL_NO_CONTEXT, kAttributes);
  if (context && eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, context)) return context;
  eglTerminate(display);  // with its contexts
  return EGL_NO_CONTEXT;
}

void release(EGLDisplay display, EGLContext context) {
  eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
  eglDestroyContext(display, context);
  eglTerminate(display);
}

}  // namespace

HeadlessContext::HeadlessContext() : display_(nullptr) {
  require_memory("drawing by OpenGL", kDriver);
  require_libraries();
  const std::vector<EGLDisplay> found = displays();
  if (found.empty()) throw Error("EGL cannot draw without a display here; {}", kAdvice);
  const char* environment = std::getenv("XRAYCAST_GL_DEVICE");
  const std::string choice = environment ? environment : "";
  std::string names;
  int number = 0;
  for (const EGLDisplay display : found) {
    display_ = display;
    context_ = context_on(display);
    if (!context_) continue;
    if (choice.empty() || names_device(choice, number, gl_device_name())) return;
    names += fmt::format("{}{}: {}", names.empty() ? "" : ", ", number++, gl_device_name());
    release(display, context_);
  }
  if (names.empty()) throw Error("no OpenGL 3.3 without a display; {}", kAdvice);
  throw InputError("no OpenGL device matches XRAYCAST_GL_DEVICE={}; available: {}", choice, names);
}

HeadlessContext::~HeadlessContext() { release(display_, context_); }

std::string gl_device_name() {
  const auto* name = reinterpret_cast<const char*>(glGetString(GL_RENDERER));
  return name ? name : "unknown";
}

}  // namespace xraycast
