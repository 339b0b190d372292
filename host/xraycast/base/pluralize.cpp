#include "xraycast/base/pluralize.hpp"

#include <string_view>

namespace xraycast {
namespace {

bool ends_in_consonant_and_y(const std::string& noun) {
  constexpr std::string_view kVowels = "aeiou";
  return noun.size() > 1 && noun.ends_with('y') &&
         kVowels.find(noun[noun.size() - 2]) == std::string_view::npos;
}

}  // namespace

std::string pluralize(std::int64_t count, const std::string& noun) {
  const std::string number = std::to_string(count) + " ";
  if (count == 1) return number + noun;
  if (ends_in_consonant_and_y(noun)) return number + noun.substr(0, noun.size() - 1) + "ies";
  return number + noun + (noun.ends_with("ch") ? "es" : "s");
}

}  // namespace xraycast
