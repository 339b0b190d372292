#pragma once

#include <nlohmann/json_fwd.hpp>

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace xraycast {

/// Maximum nesting of lists and objects; xraycast's own files need five levels.
inline constexpr int kDeepestJson = 32;

/// Parses untrusted JSON; all JSON is read through this. Invalid text gives a discarded value, which is not
/// an object, so that the caller can report what was expected. Throws InputError, with `name` in front, for
/// JSON nested more than kDeepestJson levels, because functions that visit a value recurse once per level.
nlohmann::json parse_json(std::string_view text, const std::string& name);

/// The same for files that people write by hand. Throws InputError with the line of what is invalid.
nlohmann::json parse_edited_json(std::string_view text, const std::string& name);

/// The integer that a value holds; nothing if it holds anything else, including 1.0 and 1e300, or an integer
/// of more than 64 bits. The library's own conversion accepts any number as an integer, even out of range.
std::optional<std::int64_t> whole_number(const nlohmann::json& value);

}  // namespace xraycast
