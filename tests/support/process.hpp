#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <sys/types.h>
#include <vector>

namespace xraycast {

/// A program as a user starts it.
struct Command {
  std::vector<std::string> words;                       ///< the program's path and its arguments
  std::map<std::string, std::string> environment = {};  ///< on top of the test's own
  std::optional<std::uint64_t> largest_file_B = {};     ///< writing beyond fails, as on a full disk
  bool on_terminal = false;                             ///< stderr is a terminal
  std::chrono::seconds patience{90};                    ///< after which it is killed
};

/// `words`, and after them those of `line`, apart by spaces, in which @ stands for the folder.
Command command_of(std::vector<std::string> words, const std::string& line,
                   const std::filesystem::path& folder);

/// What it left behind.
struct Finished {
  int status;  ///< its exit status, or 128 + the signal that ended it, as a shell has it
  std::string out, err;
};

/// A running program. Whatever it waits for, it is killed when its command's patience is over; its parent
/// then throws std::runtime_error with what it had said.
class Process {
 public:
  explicit Process(const Command& command);
  ~Process();
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  /// Returns once stderr holds `text`; throws when the program ends without.
  void wait_for(const std::string& text);

  /// What stderr holds so far.
  const std::string& said() const { return streams_[1].text; }

  void send(int signal) const;

  /// Waits for its end.
  Finished finish();

 private:
  using Clock = std::chrono::steady_clock;
  struct Stream {
    int file = -1;  ///< -1 once it has ended
    std::string text;
  };

  /// Waits for output and takes it in; false when all streams have ended.
  bool listen();
  [[noreturn]] void fail(const std::string& why) const;

  Clock::time_point deadline_;
  std::string name_;
  pid_t id_ = -1;  ///< -1 once it was waited for
  std::array<Stream, 2> streams_;
};

/// From start to end.
inline Finished run_process(const Command& command) { return Process(command).finish(); }

}  // namespace xraycast
