#include "xraycast/base/deflated.hpp"

#include <new>
#include <zlib.h>

namespace xraycast {

std::string deflated(std::string_view bytes, int level) {
  uLongf size_B = compressBound(bytes.size());
  std::string packed(size_B, '\0');
  if (compress2(reinterpret_cast<Bytef*>(packed.data()), &size_B,
                reinterpret_cast<const Bytef*>(bytes.data()), bytes.size(), level) != Z_OK)
    throw std::bad_alloc();
  packed.resize(size_B);
  return packed;
}

}  // namespace xraycast
