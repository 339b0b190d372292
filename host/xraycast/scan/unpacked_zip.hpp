#pragma once

#include "xraycast/base/progress.hpp"
#include "xraycast/base/temporary_folder_on_disk.hpp"

#include <filesystem>
#include <map>
#include <string>

namespace xraycast {

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
  TemporaryFolderOnDisk folder_{"xraycast-zip-"};
  std::map<std::string, std::string> names_;  ///< of the archive, by ours
};

/// Whether a file's first bytes are those of a zip archive.
bool is_zip(const std::string& leading_bytes);

}  // namespace xraycast
