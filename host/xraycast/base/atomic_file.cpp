#include "xraycast/base/atomic_file.hpp"

#include "xraycast/base/error.hpp"

#include <atomic>
#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <unistd.h>

namespace xraycast {
namespace {

/// Everything from the first dot on, so that `a.nii.gz` keeps both: writers choose the format by it.
std::string extensions(const std::filesystem::path& path) {
  const std::string name = path.filename().string();
  const auto dot = name.find('.', 1);
  return dot == std::string::npos ? "" : name.substr(dot);
}

}  // namespace

AtomicFile::AtomicFile(std::filesystem::path target) : target_(std::move(target)) {
  static std::atomic<int> serial{0};
  std::error_code error;
  const auto status = std::filesystem::status(target_, error);
  if (std::filesystem::exists(status) && !std::filesystem::is_regular_file(status))
    throw InputError("{}: not a regular file, so it is not replaced; choose another output name",
                     target_.string());
  if (target_.filename().empty()) throw InputError("{}: not a file name", target_.string());
  const auto folder = target_.has_parent_path() ? target_.parent_path() : std::filesystem::path(".");
  if (!std::filesystem::is_directory(folder, error))
    throw InputError("{}: the output folder does not exist; create it first", folder.string());

  temporary_ = folder / fmt::format(".{}.{}-{}.part{}", target_.stem().string(), getpid(), serial++,
                                    extensions(target_));
  const int file = open(temporary_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  if (file < 0) throw InputError("{}: cannot be written: {}", target_.string(), std::strerror(errno));
  close(file);
}

AtomicFile::~AtomicFile() {
  std::error_code ignored;
  if (!temporary_.empty()) std::filesystem::remove(temporary_, ignored);
}

void AtomicFile::commit() {
  std::error_code error;
  std::filesystem::rename(temporary_, target_, error);
  if (error) throw Error("{}: could not be renamed into place: {}", target_.string(), error.message());
  temporary_.clear();
}

}  // namespace xraycast
