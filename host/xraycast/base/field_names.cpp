#include "xraycast/base/field_names.hpp"

#include <algorithm>

namespace xraycast {
namespace {

bool is_identifier(std::string_view word) {
  return !word.empty() && std::ranges::all_of(word, [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_';
  });
}

}  // namespace

std::string with_names(std::string_view message,
                       const std::function<std::string(std::string_view field)>& spell) {
  std::string spelled;
  while (!message.empty()) {
    const std::size_t opening = std::min(message.find('`'), message.size());
    spelled += message.substr(0, opening);
    message.remove_prefix(opening);
    const std::size_t closing = message.find('`', 1);
    const std::string_view word =
        closing == std::string_view::npos ? std::string_view() : message.substr(1, closing - 1);
    const std::string name = is_identifier(word) ? spell(word) : "";
    spelled += name.empty() ? message.substr(0, 1) : name;
    message.remove_prefix(name.empty() ? std::min<std::size_t>(1, message.size()) : closing + 1);
  }
  return spelled;
}

}  // namespace xraycast
