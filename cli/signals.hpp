#pragma once

#include "xraycast/base/progress.hpp"

#include <string>

namespace xraycast::cli {

/// The exit status after a signal is this plus the signal's number, as in a shell.
inline constexpr int kSignalStatus = 128;

/// Waits for SIGINT, SIGTERM and SIGHUP on a thread of its own. The first one has no effect on a job whose
/// last file has its name (OutputSeries): it ends as if there were no signal. It cancels any other job, whose
/// files get no names from then on, so that it can clean up; one that has not ended after 1.5 s ends at once,
/// without its temporary files. So status and files agree however late the job is. A second signal ends the
/// process at once, whatever it does. SIGHUP stays ignored if it was, as under nohup. SIGPIPE and SIGXFSZ are
/// ignored: the failing write reports the error.
///
/// The signals are blocked in every thread of the program, from before its libraries are initialised: LLVM,
/// which compiles kernels, installs handlers that delete the files it is writing; they must never run.
class SignalWatch {
 public:
  /// Once in a process.
  explicit SignalWatch(Progress& progress);

  /// The job has ended, well or not: a signal from now on has no effect, unless it is the second one.
  void end_job();
  ~SignalWatch() { end_job(); }
  SignalWatch(const SignalWatch&) = delete;
  SignalWatch& operator=(const SignalWatch&) = delete;

  /// The signal that cancelled the job, or 0.
  static int caught();
};

/// What a cancelled job has left behind.
std::string cancelled_in_words();

}  // namespace xraycast::cli
