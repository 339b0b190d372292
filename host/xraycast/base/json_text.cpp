#include "xraycast/base/json_text.hpp"

#include "xraycast/base/error.hpp"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <utility>

namespace xraycast {

nlohmann::json parse_json(std::string_view text, const std::string& name) {
  using Event = nlohmann::json::parse_event_t;
  const auto check_depth = [&](int depth, Event event, nlohmann::json&) {
    if (depth >= kDeepestJson && (event == Event::object_start || event == Event::array_start))
      throw InputError(
          "{}: lists and objects are nested more than {} levels deep; check that xraycast can use this file",
          name, kDeepestJson);
    return true;
  };
  return nlohmann::json::parse(text.begin(), text.end(), check_depth, false);
}

nlohmann::json parse_edited_json(std::string_view text, const std::string& name) {
  nlohmann::json json = parse_json(text, name);
  if (!json.is_discarded()) return json;
  std::size_t before = 0;  // the first character that does not fit
  try {
    json = nlohmann::json::parse(text.begin(), text.end());
  } catch (const nlohmann::json::parse_error& error) {
    before = std::min(std::max<std::size_t>(error.byte, 1) - 1, text.size());
  } catch (const nlohmann::json::exception&) {
    throw InputError("{}: a number is too large", name);
  }
  throw InputError(
      "{}: line {}: no valid JSON; look for a comma, a quote or a bracket that is missing or too many", name,
      1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(before), '\n'));
}

std::optional<std::int64_t> whole_number(const nlohmann::json& value) {
  if (!value.is_number_integer() ||
      (value.is_number_unsigned() && !std::in_range<std::int64_t>(value.get<std::uint64_t>())))
    return std::nullopt;
  return value.get<std::int64_t>();
}

}  // namespace xraycast
