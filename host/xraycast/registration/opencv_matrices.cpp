#include "xraycast/registration/opencv_matrices.hpp"

#include "xraycast/base/loaded_module.hpp"

namespace xraycast {

// Measured, with a third more; most of it is what OpenBLAS reserves.
constexpr MemoryNeed kOpenCvCore{250 << 20, 30 << 20};

const OpenCvMatrices& opencv_matrices() {
  using Get = const OpenCvMatrices* (*)();
  static const OpenCvMatrices& loaded =
      *reinterpret_cast<Get>(module_function(XRAYCAST_MATRICES_MODULE, "xraycast_matrices", kOpenCvCore))();
  return loaded;
}

}  // namespace xraycast
