#pragma once

#include "xraycast/base/progress.hpp"

#include <filesystem>
#include <map>
#include <string>

namespace xraycast {

/// A folder that only this user can read and that is removed with its content; what a killed process left,
/// the next one removes.
class TemporaryFolderOnDisk {
 public:
  TemporaryFolderOnDisk();
  ~TemporaryFolderOnDisk();
  TemporaryFolderOnDisk(const TemporaryFolderOnDisk&) = delete;
  TemporaryFolderOnDisk& operator=(const TemporaryFolderOnDisk&) = delete;

  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
  int lock_ = -1;
};

/// The files of a zip archive, in a temporary folder under names of our own: one folder for each of the
/// archive's. Names in the archive are for messages only.
class UnpackedZip {
 public:
  /// Throws InputError for archives that are damaged, encrypted, or unpack to far more than their own size,
  /// and where the disk has no room for them.
  UnpackedZip(const std::filesystem::path& archive, Progress& progress);

  const std::filesystem::path& folder() const { return folder_.path(); }

  /// A message with the archive's names instead of ours.
  std::string renamed(std::string message) const;

 private:
  std::string archive_;
  TemporaryFolderOnDisk folder_;
  std::map<std::string, std::string> names_;  ///< of the archive, by ours
};

/// Whether a file's first bytes are those of a zip archive.
bool is_zip(const std::string& leading_bytes);

}  // namespace xraycast
