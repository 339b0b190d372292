#include "xraycast/base/pluralize.hpp"

namespace xraycast {

std::string pluralize(std::int64_t count, const std::string& noun) {
  const std::string number = std::to_string(count) + " ";
  if (count == 1) return number + noun;
  if (noun.ends_with("dy")) return number + noun.substr(0, noun.size() - 1) + "ies";
  return number + noun + (noun.ends_with("ch") ? "es" : "s");
}

}  // namespace xraycast
