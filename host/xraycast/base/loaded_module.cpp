#include "xraycast/base/loaded_module.hpp"

#include "xraycast/base/error.hpp"

#include <dlfcn.h>

namespace xraycast {

void* module_function(const std::string& module, const char* name, const MemoryNeed& need,
                      const char* remedy) {
  require_memory("loading " + module, need);
  void* const loaded = dlopen(module.c_str(), RTLD_NOW | RTLD_LOCAL);
  void* const function = loaded ? dlsym(loaded, name) : nullptr;
  if (!function) throw Error("{} cannot be loaded; {} ({})", module, remedy, dlerror());
  return function;
}

}  // namespace xraycast
