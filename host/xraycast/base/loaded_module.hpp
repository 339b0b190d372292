#pragma once

#include "xraycast/base/memory_limit.hpp"

#include <string>

namespace xraycast {

/// The function `name` of a module of this project, a shared library that is loaded when it is first needed
/// because its dependencies are large. The loader searches the program's RUNPATH. The module stays
/// loaded. Throws Error, naming the module and the `remedy`, when it cannot be loaded, or when there is less
/// memory than `need`.
void* module_function(const std::string& module, const char* name, const MemoryNeed& need,
                      const char* remedy = "is it installed beside the program?");

}  // namespace xraycast
