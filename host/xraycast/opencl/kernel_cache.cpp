#include "xraycast/opencl/kernel_cache.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/temporary_folder_on_disk.hpp"

#include <cstdlib>
#include <string>
#include <sys/stat.h>
#include <unistd.h>

namespace xraycast {
namespace {

namespace fs = std::filesystem;

/// PoCL's default folder; empty without a home.
fs::path pocl_folder() {
  if (const char* cache = std::getenv("XDG_CACHE_HOME"); cache && *cache)
    return fs::path(cache) / "pocl/kcache";
  if (const char* home = std::getenv("HOME"); home && *home) return fs::path(home) / ".cache/pocl/kcache";
  return {};
}

/// The folder, or what of its path is there.
fs::path existing(fs::path folder) {
  std::error_code error;
  while (!fs::exists(fs::symlink_status(folder, error)) && folder.has_relative_path())
    folder = folder.parent_path();
  return folder;
}

/// Of a folder that is there: all kernels take some megabytes, and where they do not fit LLVM ends the
/// process.
bool takes_kernels(const fs::path& folder) {
  std::error_code error;
  return fs::is_directory(folder, error) && access(folder.c_str(), W_OK | X_OK) == 0 &&
         fs::space(folder, error).available >= KernelCache::kRoom_B;
}

/// Whether nobody but this user and root can write into the folder, which is there.
bool is_private(const fs::path& folder) {
  struct stat status {};
  return stat(folder.c_str(), &status) == 0 && (status.st_uid == geteuid() || status.st_uid == 0) &&
         (status.st_mode & S_IWOTH) == 0;
}

bool is_private_and_takes_kernels(const fs::path& folder) {
  return !folder.empty() && is_private(existing(folder)) && takes_kernels(existing(folder));
}

bool finds_no_folder = false;

}  // namespace

void require_kernel_cache() {
  constexpr double kRoom_MB = KernelCache::kRoom_B / 1e6;
  const char* folder = std::getenv("POCL_CACHE_DIR");
  if (folder && !takes_kernels(existing(fs::absolute(folder))))
    throw DeviceError(
        "no OpenCL device: PoCL keeps kernels in POCL_CACHE_DIR={}, which cannot be written to or has less "
        "than {:.0f} MB left; choose another folder",
        folder, kRoom_MB);
  if (finds_no_folder)
    throw DeviceError(
        "no OpenCL device: PoCL keeps kernels in a folder, but neither the home's .cache nor the one for "
        "temporary files can be written to and has {:.0f} MB left; set POCL_CACHE_DIR to one that has",
        kRoom_MB);
}

KernelCache::KernelCache() {
  if (std::getenv("POCL_CACHE_DIR")) return;
  if (is_private_and_takes_kernels(pocl_folder())) return;
  try {
    own_ = std::make_unique<TemporaryFolderOnDisk>("xraycast-kernels-");
  } catch (const Error&) {
    finds_no_folder = true;
    return;
  }
  finds_no_folder = !takes_kernels(own_->path());
  if (!finds_no_folder) setenv("POCL_CACHE_DIR", own_->path().c_str(), 1);
}

KernelCache::~KernelCache() = default;

}  // namespace xraycast
