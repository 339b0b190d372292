#include "xraycast/geometry/text_lines.hpp"

#include "xraycast/base/plain_text.hpp"

#include <algorithm>
#include <charconv>
#include <limits>

namespace xraycast {
namespace {

constexpr std::size_t kLongestLine_B = 1 << 16;
constexpr std::string_view kBlanks = " \t\r\n\v\f";

}  // namespace

std::string_view take_word(std::string_view& text) {
  text.remove_prefix(std::min(text.find_first_not_of(kBlanks), text.size()));
  const std::string_view word = text.substr(0, text.find_first_of(kBlanks));
  text.remove_prefix(word.size());
  return word;
}

std::optional<double> real_number(std::string_view word) {
  if (word.starts_with('+')) word.remove_prefix(1);
  double number = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), number);
  if (error == std::errc::invalid_argument || end != word.data() + word.size()) return {};
  if (error == std::errc::result_out_of_range) return std::numeric_limits<double>::infinity();
  return number;
}

std::optional<std::string_view> TextLines::next() {
  if (rest_.empty()) return {};
  ++number_;
  const std::string_view line = take_line(rest_);
  if (line.size() > kLongestLine_B) fail("is longer than {} bytes", kLongestLine_B);
  return trimmed(line);
}

}  // namespace xraycast
