#pragma once

#include <nlohmann/json_fwd.hpp>

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace xraycast {

/// How deep lists and objects may lie within one another; what xraycast reads needs five levels.
inline constexpr int kDeepestJson = 32;

/// Reads JSON that others wrote; the one way in for all of it. Text that is no JSON gives a discarded value,
/// which is no object, for the caller to say what it should have been. Throws InputError, with `name` in
/// front, for JSON that is nested more than kDeepestJson levels: what walks through a value calls itself for
/// each of them.
nlohmann::json parse_json(std::string_view text, const std::string& name);

/// The integer that a value holds; nothing where it holds anything else, 1.0 and 1e300 among it, or one of
/// more than 64 bits. The library's own conversion takes any number for an integer, whether it fits or not.
std::optional<std::int64_t> whole_number(const nlohmann::json& value);

}  // namespace xraycast
