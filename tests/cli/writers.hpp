#pragma once

#include "support/process.hpp"
#include "support/temporary_folder.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <map>
#include <ostream>
#include <random>
#include <span>
#include <string>

namespace xraycast {

/// A folder's files: how long they are, and a hash of what they hold.
using Content = std::map<std::string, std::pair<std::uintmax_t, std::size_t>>;

Content content_of(const std::filesystem::path& folder);

/// Runs of the program in a folder of their own, for which @ stands in what they are given.
class CliOutput : public testing::Test {
 protected:
  /// `line` is what follows the program's name.
  Command command(const std::string& line) const;
  std::string replaced(std::string text) const;
  Finished run(const std::string& line) const { return run_process(command(line)); }

  /// In a shell, where PROGRAM stands for the program.
  Finished run_in_shell(std::string line) const;

  static void expect_one_line(const std::string& err, const std::string& part);

  /// Scans, a map, a basis, a tree and a script, small enough for hundreds of runs, and an empty folder
  /// `out`.
  void make_inputs() const;

  TemporaryFolder folder_;
};

/// When the files of a run get their names.
enum class Appearing { together, one_by_one, as_a_new_folder };

/// A run of a writing subcommand.
struct Writer {
  const char* name;
  const char* line;  ///< everything that it writes goes into @/out
  Appearing appearing = Appearing::together;
};
inline void PrintTo(const Writer& writer, std::ostream* out) { *out << writer.name; }

/// Of every kind of output of every subcommand that writes some, but for the window's.
std::span<const Writer> writers();

/// A writer whose outputs are there already, older.
class EveryWriter : public CliOutput, public testing::WithParamInterface<Writer> {
 protected:
  void SetUp() override;

  Content found() const { return content_of(folder_ / "out"); }
  void put_old_files() const;

  /// A full disk has status 1 and one line that names the file and what is needed, and no file is touched.
  void expect_failure(const Command& on_full_disk, const std::string& when) const;
  /// A disk that takes so many bytes, as FULL_DISK_LIBRARY plays it.
  Command on_disk_of(std::uintmax_t size_B) const;
  /// One that says only when files are synced that it is full.
  Command on_late_disk() const;

  /// Sends the signal at a random moment of the first `latest_s` seconds of a run, and expects what is
  /// promised of the files then, and of those of a later run. Returns whether the signal ended the run.
  bool expect_survival(int signal, double latest_s, std::mt19937& random) const;

  double took_s_ = 0;          ///< the first run, which may have met a busier machine than later ones
  std::uintmax_t size_B_ = 0;  ///< of all that a run writes
  std::map<std::string, std::uintmax_t> whole_;
  Content old_;

 private:
  /// Neither partial ones nor, unless they are `.part`s that may be left, others.
  void expect_whole_or_old_files(bool may_leave_parts) const;
  void expect_whole_files() const;
  bool is_whole(const std::string& name, std::uintmax_t size_B) const;
  bool is_kept_copy(const std::string& name, const Content::mapped_type& content) const;
};

}  // namespace xraycast
