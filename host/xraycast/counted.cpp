#include "xraycast/counted.hpp"

namespace xraycast {

std::string counted(std::int64_t count, const std::string& noun) {
  const char* plural = noun.ends_with("ch") ? "es" : "s";
  return std::to_string(count) + " " + noun + (count == 1 ? "" : plural);
}

}  // namespace xraycast
