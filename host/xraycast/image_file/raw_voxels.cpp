#include "xraycast/image_file/raw_voxels.hpp"

#include "xraycast/base/error.hpp"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <unistd.h>
#include <utility>

namespace xraycast {

RawVoxels::RawVoxels(const std::filesystem::path& file, std::int64_t offset_B, std::int64_t needed_B)
    : path_(file), offset_B_(offset_B) {
  std::error_code error;
  const auto size_B = static_cast<std::int64_t>(std::filesystem::file_size(file, error));
  if (error)
    throw InputError("{}: cannot be opened: {}; check its permissions", file.string(), error.message());
  if (size_B - offset_B < needed_B)
    throw InputError("{}: truncated, {} of {} bytes of voxels are there; copy the file again", file.string(),
                     std::max<std::int64_t>(0, size_B - offset_B), needed_B);
  file_ = open(file.c_str(), O_RDONLY | O_CLOEXEC);
  if (file_ < 0)
    throw InputError("{}: cannot be opened: {}; check its permissions", file.string(), std::strerror(errno));
}

RawVoxels::RawVoxels(RawVoxels&& other) noexcept
    : path_(std::move(other.path_)), offset_B_(other.offset_B_), file_(std::exchange(other.file_, -1)) {}

RawVoxels::~RawVoxels() {
  if (file_ >= 0) close(file_);
}

void RawVoxels::read(std::int64_t first_B, std::span<char> bytes) const {
  while (!bytes.empty()) {
    const ssize_t count = pread(file_, bytes.data(), bytes.size(), offset_B_ + first_B);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0)
      throw InputError("{}: the voxels could not be read: {}; copy the file again", path_.string(),
                       count < 0 ? std::strerror(errno) : "it was truncated while being read");
    first_B += count;
    bytes = bytes.subspan(static_cast<std::size_t>(count));
  }
}

}  // namespace xraycast
