#include "xraycast/base/device_choice.hpp"

#include "xraycast/base/plain_text.hpp"

#include <algorithm>
#include <cctype>

namespace xraycast {
bool names_device(const std::string& choice, int number, const std::string& name) {
  const bool is_number = std::ranges::all_of(choice, [](unsigned char c) { return std::isdigit(c); });
  return is_number ? std::to_string(number) == choice
                   : lower_case(name).find(lower_case(choice)) != std::string::npos;
}

}  // namespace xraycast
