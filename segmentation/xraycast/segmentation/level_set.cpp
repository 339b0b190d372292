#include "xraycast/segmentation/level_set.hpp"

#include "xraycast/base/loaded_module.hpp"

namespace xraycast {

// Measured, with a third more.
constexpr MemoryNeed kOpenVdb{100 << 20, 30 << 20};

std::unique_ptr<LevelSet> level_set_of(const Mask& mask) {
  using Make = LevelSet* (*)(const Mask&);
  static const auto make =
      reinterpret_cast<Make>(module_function(XRAYCAST_LEVEL_SET_MODULE, "xraycast_level_set", kOpenVdb));
  return std::unique_ptr<LevelSet>(make(mask));
}

}  // namespace xraycast
