#pragma once

#include <filesystem>

namespace xraycast {

/// A file that appears under its name only when it is whole. It is written under a temporary name beside the
/// target and renamed by commit(); without commit() the temporary file is removed and the target stays as it
/// was.
///
/// Make one before long work starts: the constructor already finds out whether the target can be written.
class AtomicFile {
 public:
  /// Throws InputError when the folder does not exist or is not writable, or when the target exists and is
  /// not a regular file.
  explicit AtomicFile(std::filesystem::path target);
  ~AtomicFile();
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  const std::filesystem::path& target() const { return target_; }

  /// Where to write: in the target's folder, with the target's extension.
  const std::filesystem::path& temporary() const { return temporary_; }

  /// Renames the finished file. Throws Error when that fails.
  void commit();

 private:
  std::filesystem::path target_, temporary_;
};

/// Throws as AtomicFile's constructor would, and leaves nothing behind: called before long work whose result
/// goes to `target`.
inline void check_writable(const std::filesystem::path& target) { const AtomicFile probe(target); }

}  // namespace xraycast
