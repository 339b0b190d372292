#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstring>
#include <type_traits>

namespace xraycast {

static_assert(std::endian::native == std::endian::little, "numbers in that order are copied as they are");

/// A type of numbers as files store them.
struct StoredNumber {
  std::size_t size_B = 0;
  bool is_integer = false;
  double (*read)(const char* bytes, bool is_big_endian) = nullptr;
};

template <typename T>
constexpr StoredNumber stored_number() {
  return {sizeof(T), std::is_integral_v<T>, [](const char* bytes, bool is_big_endian) {
            std::array<char, sizeof(T)> number;
            std::memcpy(number.data(), bytes, sizeof(T));
            if (is_big_endian) std::ranges::reverse(number);
            return static_cast<double>(std::bit_cast<T>(number));
          }};
}

}  // namespace xraycast
