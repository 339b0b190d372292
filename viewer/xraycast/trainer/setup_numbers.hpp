#pragma once

#include "xraycast/base/error.hpp"

#include <cmath>
#include <span>

namespace xraycast {

/// Takes the numbers of a setup one after the other. Throws InputError, with `name` in front, where they end
/// early or are no such numbers.
class SetupNumbers {
 public:
  SetupNumbers(const char* name, std::span<const double> numbers) : name_(name), left_(numbers) {}

  double real() {
    if (left_.empty()) throw InputError("{}: its data end early", name_);
    const double number = left_.front();
    left_ = left_.subspan(1);
    return number;
  }

  /// At most as many as there are numbers left, so that no list is longer than its data.
  std::size_t count() {
    const double number = real();
    if (!(number >= 0 && number <= static_cast<double>(left_.size())))
      throw InputError("{}: its data end early", name_);
    return static_cast<std::size_t>(number);
  }

  /// Within that of 0.
  int whole(int most) {
    const double number = real();
    if (!(std::abs(number) <= most)) throw InputError("{}: {} is out of range", name_, number);
    return static_cast<int>(number);
  }

  /// From -1 on.
  int index() {
    constexpr double kMost = 1e6;
    const double number = real();
    if (!(number >= -1 && number <= kMost))
      throw InputError("{}: {} is no number of a branch or a choice", name_, number);
    return static_cast<int>(number);
  }

 private:
  const char* name_;
  std::span<const double> left_;
};

}  // namespace xraycast
