#include "xraycast/segmentation/level_set.hpp"

#include "xraycast/base/error.hpp"

#include <dlfcn.h>
#include <string>

namespace xraycast {

std::unique_ptr<LevelSet> level_set_of(const Mask& mask) {
  // Found by the program's RUNPATH. It stays loaded: its meshes outlive this call.
  static void* const module = dlopen(XRAYCAST_LEVEL_SET_MODULE, RTLD_NOW | RTLD_LOCAL);
  static const std::string reason = module ? "" : dlerror();
  static const auto make =
      module ? reinterpret_cast<LevelSet* (*)(const Mask&)>(dlsym(module, "xraycast_level_set")) : nullptr;
  if (!make)
    throw Error("{} cannot be loaded; install it beside the program: {}", XRAYCAST_LEVEL_SET_MODULE, reason);
  return std::unique_ptr<LevelSet>(make(mask));
}

}  // namespace xraycast
