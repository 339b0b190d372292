#include "xraycast/base/whole_file.hpp"

#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/memory_limit.hpp"

#include <cerrno>
#include <cstring>
#include <fstream>

namespace xraycast {

void require_regular_file(const std::filesystem::path& path) {
  std::error_code error;
  const auto status = std::filesystem::status(path, error);
  if (!std::filesystem::exists(status)) throw InputError("{}: no such file; check its name", path.string());
  if (std::filesystem::is_directory(status))
    throw InputError("{}: a folder, but a file is needed here; give the file", path.string());
  if (!std::filesystem::is_regular_file(status))
    throw InputError("{}: not a regular file; give the file itself, not a pipe or device", path.string());
}

std::string read_whole_file(const std::filesystem::path& path) {
  require_regular_file(path);
  std::error_code error;
  std::ifstream file(path, std::ios::binary);
  const auto size = std::filesystem::file_size(path, error);
  if (!file || error)
    throw InputError("{}: cannot be opened: {}; check its permissions", path.string(), std::strerror(errno));
  const auto needed_B = static_cast<std::int64_t>(size);
  constexpr std::int64_t kSmall_B = 1 << 20;
  if (needed_B > kSmall_B) require_memory("reading " + path.string(), {needed_B, needed_B});
  std::string content(size, '\0');
  if (!file.read(content.data(), static_cast<std::streamsize>(size)))
    throw InputError("{}: cannot be read: {}; copy it again", path.string(), std::strerror(errno));
  return content;
}

void write_whole_file(const std::filesystem::path& path, std::string_view content) {
  AtomicFile target(path);
  target.write(content, std::ssize(content));
  target.commit();
}

}  // namespace xraycast
