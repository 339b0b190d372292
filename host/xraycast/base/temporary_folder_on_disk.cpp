#include "xraycast/base/temporary_folder_on_disk.hpp"

#include "xraycast/base/error.hpp"

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fcntl.h>
#include <random>
#include <string_view>
#include <sys/file.h>
#include <sys/stat.h>
#include <system_error>
#include <unistd.h>
#include <utility>

namespace xraycast {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kDigits = 16;

std::string any_name(const std::string& kind) {
  std::random_device random;
  return fmt::format("{}{:08x}{:08x}", kind, random(), random());
}

/// Whether any_name() may have made it.
bool is_our_name(std::string_view name, std::string_view kind) {
  return name.starts_with(kind) && name.size() == kind.size() + kDigits &&
         name.find_first_not_of("0123456789abcdef", kind.size()) == std::string_view::npos;
}

int open_folder(const fs::path& folder) {
  return open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
}

/// Whether an open folder is this user's, and nobody else can read it.
bool is_private(int folder) {
  struct stat status {};
  return fstat(folder, &status) == 0 && status.st_uid == geteuid() && (status.st_mode & 0777) == 0700;
}

/// 0, or why not: EWOULDBLOCK where another process holds it, others where the file system has no locks.
int lock(int folder) { return flock(folder, LOCK_EX | LOCK_NB) == 0 ? 0 : errno; }

void remove_abandoned(const fs::path& parent, const std::string& kind) {
  std::error_code error;
  for (fs::directory_iterator entry(parent, error), end; !error && entry != end; entry.increment(error)) {
    if (!is_our_name(entry->path().filename().string(), kind)) continue;
    const int folder = open_folder(entry->path());
    if (folder < 0) continue;
    std::error_code ignored;
    if (is_private(folder) && lock(folder) == 0) fs::remove_all(entry->path(), ignored);
    close(folder);
  }
}

Error refusal(const fs::path& parent, int reason) {
  return Error("{}: no temporary folder can be made: {}; set TMPDIR to one that is writable", parent.string(),
               std::strerror(reason));
}

}  // namespace

TemporaryFolderOnDisk::TemporaryFolderOnDisk(const std::string& kind) {
  std::error_code error;
  const fs::path parent = fs::temp_directory_path(error);
  if (error)
    throw Error("{}: no folder for temporary files; set TMPDIR to one that is writable", parent.string());
  remove_abandoned(parent, kind);
  constexpr int kAttempts = 10;
  for (int attempt = 0; attempt < kAttempts && lock_ < 0; ++attempt) {
    path_ = parent / any_name(kind);
    if (mkdir(path_.c_str(), 0700) != 0) throw refusal(parent, errno);
    take();
  }
  if (lock_ < 0) throw refusal(parent, EWOULDBLOCK);
}

void TemporaryFolderOnDisk::take() {
  lock_ = open_folder(path_);
  const int reason = errno;
  if (lock_ < 0 && reason != ENOENT) {
    rmdir(path_.c_str());
    throw refusal(path_.parent_path(), reason);
  }
  // Another process may take the folder for an abandoned one before it is locked, and remove it. Where the
  // file system has no locks, nobody removes it.
  std::error_code ignored;
  if (lock_ >= 0 && (lock(lock_) == EWOULDBLOCK || !fs::exists(path_, ignored)))
    close(std::exchange(lock_, -1));
}

TemporaryFolderOnDisk::~TemporaryFolderOnDisk() {
  std::error_code error;
  fs::remove_all(path_, error);
  close(lock_);
}

}  // namespace xraycast
