#include "xraycast/base/json_text.hpp"

#include "xraycast/base/error.hpp"

#include <nlohmann/json.hpp>

namespace xraycast {

nlohmann::json parse_json(std::string_view text, const std::string& name) {
  using Event = nlohmann::json::parse_event_t;
  const auto check_depth = [&](int depth, Event event, nlohmann::json&) {
    if (depth >= kDeepestJson && (event == Event::object_start || event == Event::array_start))
      throw InputError("{}: lists and objects are nested more than {} levels deep; xraycast's files are not",
                       name, kDeepestJson);
    return true;
  };
  return nlohmann::json::parse(text.begin(), text.end(), check_depth, false);
}

}  // namespace xraycast
