#pragma once

#include <filesystem>
#include <string>

namespace xraycast {

/// A folder below the one for temporary files that only this user can read, and that is removed with its
/// content. Its name is its kind and 16 random hexadecimal digits. What killed processes left of the same
/// kind goes when the next one is made; a lock tells that apart from what a process still uses. Where the
/// file system has no locks it stays.
class TemporaryFolderOnDisk {
 public:
  /// `kind` starts its name, such as "xraycast-zip-". Throws Error where none can be made.
  explicit TemporaryFolderOnDisk(const std::string& kind);
  ~TemporaryFolderOnDisk();
  TemporaryFolderOnDisk(const TemporaryFolderOnDisk&) = delete;
  TemporaryFolderOnDisk& operator=(const TemporaryFolderOnDisk&) = delete;

  const std::filesystem::path& path() const { return path_; }

 private:
  /// Opens and locks the new folder; without effect where another process has removed it.
  void take();

  std::filesystem::path path_;
  int lock_ = -1;  ///< the open folder
};

}  // namespace xraycast
