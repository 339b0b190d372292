#include "xraycast/base/file_extension.hpp"

namespace xraycast {
namespace {

std::string lower_case(std::string text) {
  for (char& c : text)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return text;
}

}  // namespace

std::string extension_of(const std::filesystem::path& path) { return lower_case(path.extension().string()); }

bool has_extension(const std::filesystem::path& path, std::string_view extension) {
  const std::string name = lower_case(path.filename().string());
  return name.size() > extension.size() && name.ends_with(extension);
}

}  // namespace xraycast
