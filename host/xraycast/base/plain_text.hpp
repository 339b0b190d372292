#pragma once

#include <charconv>
#include <string>
#include <string_view>

namespace xraycast {

/// A text without surrounding blanks, tabs and carriage returns; a view into `text` itself.
std::string_view trimmed(std::string_view text);

/// Takes the first line off `text`, without its end; the last one may lack it.
std::string_view take_line(std::string_view& text);

/// ASCII letters in lower case, in any locale.
std::string lower_case(std::string_view text);

/// Reads a text that is one number and nothing else, in any locale; false for every other text.
template <typename Number>
bool parse_whole(std::string_view text, Number& number) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  return error == std::errc{} && end == text.data() + text.size();
}

}  // namespace xraycast
