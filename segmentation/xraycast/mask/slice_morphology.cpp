#include "xraycast/mask/slice_morphology.hpp"

#include "xraycast/base/loaded_module.hpp"

namespace xraycast {

// Measured, with a third more; most of it is what OpenBLAS reserves.
constexpr MemoryNeed kOpenCv{250 << 20, 30 << 20};

const SliceMorphology& slice_morphology() {
  using Get = const SliceMorphology* (*)();
  static const SliceMorphology& loaded =
      *reinterpret_cast<Get>(module_function(XRAYCAST_MORPHOLOGY_MODULE, "xraycast_morphology", kOpenCv))();
  return loaded;
}

}  // namespace xraycast
