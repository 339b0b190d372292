#pragma once

#include "xraycast/base/error.hpp"

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

namespace xraycast {

/// Takes the first word off a text: what stands between blanks and line breaks. Empty where none is left.
std::string_view take_word(std::string_view& text);

/// The number that a word is, infinite where it is beyond a double's; nothing for any other word.
std::optional<double> real_number(std::string_view word);

/// The lines of an untrusted text.
class TextLines {
 public:
  /// `text` must outlive it; `name` is the file's.
  TextLines(std::string_view text, std::string name) : rest_(text), name_(std::move(name)) {}

  /// The next line without surrounding blanks; nothing at the end. Throws InputError for a line of more than
  /// 64 KiB.
  std::optional<std::string_view> next();

  /// What follows the last line taken.
  std::string_view rest() const { return rest_; }

  /// Throws InputError, naming the file and the last line taken.
  template <typename... Args>
  [[noreturn]] void fail(fmt::format_string<Args...> format, Args&&... args) const {
    throw InputError("{}: line {}: {}", name_, number_, fmt::format(format, std::forward<Args>(args)...));
  }

 private:
  std::string_view rest_;
  std::string name_;
  std::size_t number_ = 0;
};

}  // namespace xraycast
