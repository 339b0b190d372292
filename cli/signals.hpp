#pragma once

#include "xraycast/base/progress.hpp"

#include <string>

namespace xraycast::cli {

/// The exit status after a signal is this plus the signal's number, as in a shell.
inline constexpr int kSignalStatus = 128;

/// Waits for SIGINT, SIGTERM and SIGHUP on a thread of its own. The first one cancels `progress`, so that the
/// job can clean up; a second one, or a job that has not ended after 1.5 s (1.9 s, when it has written a file
/// by then), removes temporary files and ends the process at once. SIGHUP stays ignored if it was, as under
/// nohup. SIGPIPE and SIGXFSZ are ignored: the failing write reports the error.
///
/// The signals are blocked in every thread of the program, from before its libraries are initialised: LLVM,
/// which compiles kernels, installs handlers that delete the files it is writing; they must never run.
class SignalWatch {
 public:
  /// Once in a process.
  explicit SignalWatch(Progress& progress);

  /// The job is done: a signal from now on has no effect, unless it is the second one.
  ~SignalWatch();
  SignalWatch(const SignalWatch&) = delete;
  SignalWatch& operator=(const SignalWatch&) = delete;

  /// The first signal that came, or 0.
  static int caught();
};

/// What a cancelled job has left behind.
std::string cancelled_in_words();

}  // namespace xraycast::cli
