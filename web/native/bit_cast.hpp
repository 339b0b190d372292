// Included before all sources: the C++ library of Debian's emscripten has no std::bit_cast, though its
// compiler can do it.
#pragma once

#include <bit>

#if !defined(__cpp_lib_bit_cast)
namespace std {

template <typename To, typename From>
constexpr To bit_cast(const From& from) noexcept {
  return __builtin_bit_cast(To, from);
}

}  // namespace std
#endif
