#pragma once

#include "xraycast/base/error.hpp"

#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace xraycast {

/// A file that appears under its name only when it is complete. It is written under a temporary name next to
/// the target, flushed to the disk, and renamed by commit(); without commit() the temporary file is removed
/// and the target stays as it was.
///
/// An existing file keeps its permissions. If the target is a symbolic link, the file that it points to is
/// replaced and the link stays. A pipe, a device such as /dev/null, or a file that this process has open,
/// such as /dev/stdout, is not replaced; commit() writes the content into it.
///
/// The temporary file has an unpredictable name, and is locked (flock) for as long as its writer lives: the
/// next AtomicFile of the same target removes those that dead processes left.
///
/// Make one before long work starts: the constructor already finds out whether the target can be written.
class AtomicFile {
 public:
  /// Throws InputError when the folder does not exist or is not writable, when the target is a dangling link,
  /// and when it exists and can be neither replaced nor written to. Throws Error when the disk is full.
  explicit AtomicFile(std::filesystem::path target);
  ~AtomicFile();
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  const std::filesystem::path& target() const { return target_; }

  /// Where to write, until commit(): a file with the target's extension.
  const std::filesystem::path& temporary() const;

  /// Appends, for callers that do not write through the temporary name. Throws `failure` when the disk is
  /// full. `needed_B` is the size of the whole file, or a bound of it, for that message.
  void write(std::string_view bytes, std::int64_t needed_B = 0);

  /// The error to throw when writing failed: one line with the target, the reason (an errno, or 0 for none)
  /// and, if `needed_B` is above 0, the room that the file needs.
  Error failure(int reason, std::int64_t needed_B = 0) const;

  /// Flushes the finished file to the disk and renames it, or leaves that to the OutputSet of this thread.
  /// Throws Error when that fails, and Cancelled after close_outputs().
  void commit();

 private:
  friend class OutputSet;
  class Temporary;

  std::filesystem::path target_;
  std::unique_ptr<Temporary> temporary_;  ///< none after commit()
};

/// Files that appear together: a file that this thread commits while an OutputSet lives is on the disk, but
/// gets its name only at the set's commit(), in the order of the files' own commits. Without it all of them
/// are removed. A nested set passes its files to the outer one.
class OutputSet {
 public:
  OutputSet();
  ~OutputSet();
  OutputSet(const OutputSet&) = delete;
  OutputSet& operator=(const OutputSet&) = delete;

  /// Throws Error when a file cannot be renamed, and Cancelled, before any is, after close_outputs().
  void commit();

 private:
  friend class AtomicFile;
  OutputSet* outer_;
  std::vector<std::unique_ptr<AtomicFile::Temporary>> files_;
};

/// Files that appear one after the other, such as the frames of a cine: while one lives, a file that gets its
/// name is not the last of its job. Any other file, or set of them, is.
class OutputSeries {
 public:
  OutputSeries();
  ~OutputSeries();
  OutputSeries(const OutputSeries&) = delete;
  OutputSeries& operator=(const OutputSeries&) = delete;
};

/// A folder that appears under its name only when all its files are complete. They are written into a
/// temporary folder next to the target, which is named, locked and cleaned up like an AtomicFile's and is
/// renamed by commit(); without commit() it is removed.
class AtomicFolder {
 public:
  /// Throws InputError when the target exists and is not an empty folder, or cannot be created.
  explicit AtomicFolder(std::filesystem::path target);
  ~AtomicFolder();
  AtomicFolder(const AtomicFolder&) = delete;
  AtomicFolder& operator=(const AtomicFolder&) = delete;

  /// Writes a file and flushes it to the disk. Throws Error when the disk is full; `needed_B` is the size of
  /// the whole folder, for that message.
  void write(const std::string& name, std::initializer_list<std::string_view> parts,
             std::int64_t needed_B = 0) const;

  /// Throws Error when the folder cannot be renamed, as when another one has appeared.
  void commit();

 private:
  class Temporary;
  std::filesystem::path target_;
  std::unique_ptr<Temporary> temporary_;  ///< none after commit()
};

/// Throws as AtomicFile's constructor would, and leaves nothing behind: called before long work whose result
/// goes to `target`.
inline void check_writable(const std::filesystem::path& target) { const AtomicFile probe(target); }

/// How many files this process has put under their names so far.
int files_written();

/// Called when the job of this process is told to end; waits while files get their names. False, without
/// effect, when the job's last file has its name. Else no file gets one any more: from now on AtomicFile and
/// AtomicFolder throw Cancelled where they are made and committed. Within an OutputSeries files still may.
bool close_outputs();

/// Called when all that is left to do is to write last files, also where the job was told to end, as of a
/// session that goes on until then: from now on close_outputs() and abandon_outputs() are without effect.
void keep_outputs();

/// As close_outputs(), within an OutputSeries too, and removes all temporary files and folders: for a process
/// that then ends at once.
bool abandon_outputs();

}  // namespace xraycast
