#include "xraycast/viewer/headless_context.hpp"

#include "xraycast/error.hpp"

#include <epoxy/egl.h>
#include <epoxy/gl.h>

namespace xraycast {
namespace {

constexpr const char* kAdvice =
    "install libegl1 and libgl1-mesa-dri, which draw in software where there is no GPU";

}  // namespace

HeadlessContext::HeadlessContext() : display_(nullptr) {
  if (!epoxy_has_egl_extension(EGL_NO_DISPLAY, "EGL_MESA_platform_surfaceless"))
    throw Error("EGL has no surfaceless platform here; {}", kAdvice);
  display_ = eglGetPlatformDisplayEXT(EGL_PLATFORM_SURFACELESS_MESA, nullptr, nullptr);
  if (!display_ || !eglInitialize(display_, nullptr, nullptr))
    throw Error("EGL does not start without a display; {}", kAdvice);
  eglBindAPI(EGL_OPENGL_API);
  constexpr EGLint kAttributes[] = {EGL_CONTEXT_MAJOR_VERSION,
                                    3,
                                    EGL_CONTEXT_MINOR_VERSION,
                                    3,
                                    EGL_CONTEXT_OPENGL_PROFILE_MASK,
                                    EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT,
                                    EGL_NONE};
  context_ = eglCreateContext(display_, EGL_NO_CONFIG_KHR, EGL_NO_CONTEXT, kAttributes);
  if (!context_ || !eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, context_)) {
    eglTerminate(display_);
    throw Error("there is no OpenGL 3.3 without a display; {}", kAdvice);
  }
}

HeadlessContext::~HeadlessContext() {
  eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
  eglDestroyContext(display_, context_);
  eglTerminate(display_);
}

std::string gl_device_name() {
  const auto* name = reinterpret_cast<const char*>(glGetString(GL_RENDERER));
  return name ? name : "unknown";
}

}  // namespace xraycast
