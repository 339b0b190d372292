#pragma once

#include <nlohmann/json_fwd.hpp>

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

}  // namespace xraycast
