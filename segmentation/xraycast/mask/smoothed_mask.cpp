#include "xraycast/mask/smoothed_mask.hpp"

#include "xraycast/base/loaded_module.hpp"

namespace xraycast {

// Measured, with a third more.
constexpr MemoryNeed kOpenVdb{100 << 20, 30 << 20};

std::unique_ptr<SmoothedMask> smoothed_mask(const Mask& mask, const Mask& thin) {
  using Make = SmoothedMask* (*)(const Mask&, const Mask&);
  static const auto make = reinterpret_cast<Make>(
      module_function(XRAYCAST_SMOOTHED_MASK_MODULE, "xraycast_smoothed_mask", kOpenVdb));
  return std::unique_ptr<SmoothedMask>(make(mask, thin));
}

}  // namespace xraycast
