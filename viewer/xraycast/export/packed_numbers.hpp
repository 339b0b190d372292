#pragma once

#include <cstdint>
#include <string>

namespace xraycast {

/// A list of whole numbers, small ones in one byte: seven bits a byte, the lowest first, the sign in the
/// lowest bit.
class PackedNumbers {
 public:
  void add(std::int64_t number) {
    auto coded = (static_cast<std::uint64_t>(number) << 1) ^ (number < 0 ? ~std::uint64_t{0} : 0);
    for (; coded > 127; coded >>= 7) bytes_ += static_cast<char>(coded | 128);
    bytes_ += static_cast<char>(coded);
  }
  const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

}  // namespace xraycast
