#include "xraycast/base/file_extension.hpp"

#include "xraycast/base/plain_text.hpp"

namespace xraycast {
std::string extension_of(const std::filesystem::path& path) { return lower_case(path.extension().string()); }

bool has_extension(const std::filesystem::path& path, std::string_view extension) {
  const std::string name = lower_case(path.filename().string());
  return name.size() > extension.size() && name.ends_with(extension);
}

}  // namespace xraycast
