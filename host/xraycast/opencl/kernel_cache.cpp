#include "xraycast/opencl/kernel_cache.hpp"

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

/// Whether the folder is there, or can be made, and nobody but this user and root can write into it.
bool is_private_and_writable(fs::path folder) {
  std::error_code error;
  while (!fs::exists(fs::symlink_status(folder, error)) && folder.has_relative_path())
    folder = folder.parent_path();
  struct stat status {};
  return stat(folder.c_str(), &status) == 0 && S_ISDIR(status.st_mode) &&
         (status.st_uid == geteuid() || status.st_uid == 0) && (status.st_mode & S_IWOTH) == 0 &&
         access(folder.c_str(), W_OK | X_OK) == 0;
}

}  // namespace

KernelCache::KernelCache() {
  if (std::getenv("POCL_CACHE_DIR")) return;
  if (const fs::path folder = pocl_folder(); !folder.empty() && is_private_and_writable(folder)) return;
  std::error_code error;
  std::string name = (fs::temp_directory_path(error) / "xraycast-kernels-XXXXXX").string();
  if (error || mkdtemp(name.data()) == nullptr) return;  // ComputeDevice reports what is missing
  own_ = name;
  setenv("POCL_CACHE_DIR", own_.c_str(), 1);
}

KernelCache::~KernelCache() {
  std::error_code ignored;
  if (!own_.empty()) fs::remove_all(own_, ignored);
}

}  // namespace xraycast
