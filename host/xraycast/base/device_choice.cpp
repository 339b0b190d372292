#include "xraycast/base/device_choice.hpp"

#include <algorithm>
#include <cctype>

namespace xraycast {
namespace {

std::string lower(std::string text) {
  std::ranges::transform(text, text.begin(),
                         [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

}  // namespace

bool names_device(const std::string& choice, int number, const std::string& name) {
  const bool is_number = std::ranges::all_of(choice, [](unsigned char c) { return std::isdigit(c); });
  return is_number ? std::to_string(number) == choice : lower(name).find(lower(choice)) != std::string::npos;
}

}  // namespace xraycast
