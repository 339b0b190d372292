#pragma once

#include "xraycast/base/plain_text.hpp"

#include <optional>
#include <string>
#include <string_view>
#include <utility>

namespace xraycast {

/// `heart=0.75`: a name and its number, which goes from the last equals sign to the end. None for every other
/// text.
template <typename Number>
std::optional<std::pair<std::string, Number>> parse_named_number(std::string_view text) {
  const auto equals = text.rfind('=');
  Number number{};
  if (equals == std::string_view::npos || equals == 0 || !parse_whole(text.substr(equals + 1), number))
    return std::nullopt;
  return std::pair{std::string(text.substr(0, equals)), number};
}

}  // namespace xraycast
