#include "xraycast/base/temporary_folder_on_disk.hpp"

#include "xraycast/base/error.hpp"

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <system_error>
#include <unistd.h>
#include <utility>

namespace xraycast {
namespace {

namespace fs = std::filesystem;

/// A lock on a folder of this user; -1 where another process holds it, or it is no such folder.
int lock_folder(const fs::path& folder) {
  const int file = open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
  struct stat status {};
  if (file >= 0 && fstat(file, &status) == 0 && status.st_uid == geteuid() &&
      flock(file, LOCK_EX | LOCK_NB) == 0)
    return file;
  if (file >= 0) close(file);
  return -1;
}

void remove_abandoned(const fs::path& parent, const std::string& kind) {
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(parent, error)) {
    if (!entry.path().filename().string().starts_with(kind)) continue;
    const int lock = lock_folder(entry.path());
    if (lock < 0) continue;
    fs::remove_all(entry.path(), error);
    close(lock);
  }
}

}  // namespace

TemporaryFolderOnDisk::TemporaryFolderOnDisk(const std::string& kind) {
  std::error_code error;
  const fs::path parent = fs::temp_directory_path(error);
  if (error)
    throw Error("{}: no folder for temporary files; set TMPDIR to one that is writable", parent.string());
  remove_abandoned(parent, kind);
  // Another process may take the folder for an abandoned one before it is locked.
  for (int attempt = 0; attempt < 10 && lock_ < 0; ++attempt) {
    std::string name = (parent / kind).string() + "XXXXXX";
    if (!mkdtemp(name.data()))
      throw Error("{}: no temporary folder can be made: {}; set TMPDIR to one that is writable",
                  parent.string(), std::strerror(errno));
    path_ = name;
    lock_ = lock_folder(path_);
    if (lock_ >= 0 && !fs::exists(path_)) close(std::exchange(lock_, -1));
  }
  if (lock_ < 0)
    throw Error("{}: a temporary folder cannot be locked; set TMPDIR to another", parent.string());
}

TemporaryFolderOnDisk::~TemporaryFolderOnDisk() {
  std::error_code error;
  fs::remove_all(path_, error);
  close(lock_);
}

}  // namespace xraycast
