#include "xraycast/base/pluralize.hpp"

namespace xraycast {

std::string pluralize(std::int64_t count, const std::string& noun) {
  const char* plural = noun.ends_with("ch") ? "es" : "s";
  return std::to_string(count) + " " + noun + (count == 1 ? "" : plural);
}

}  // namespace xraycast
