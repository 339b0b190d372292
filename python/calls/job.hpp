#pragma once

#include "xraycast/base/progress.hpp"

#include <functional>
#include <nanobind/nanobind.h>
#include <optional>
#include <type_traits>
#include <utility>

namespace xraycast::python {

namespace nb = nanobind;

/// Runs long work on a thread of its own, without the interpreter's lock. Meanwhile the calling thread tells
/// `listener` (None, a callable or a tqdm bar; see xraycast/_progress.py) of the progress, and looks for
/// Ctrl-C. Either's exception cancels the work, and is thrown when that has stopped; else the work's own is.
void run_job(const nb::object& listener, const std::function<void(Progress& progress)>& work);

/// The same for work with a result.
template <typename Work>
auto result_of(const nb::object& listener, const Work& work) {
  std::optional<std::invoke_result_t<Work, Progress&>> result;
  run_job(listener, [&](Progress& progress) { result.emplace(work(progress)); });
  return std::move(*result);
}

/// While this lives, the thread that made it starts no jobs: run_job() throws InputError with these words.
/// For Python functions that are called from within a job, which would wait for each other.
class NoJobsHere {
 public:
  explicit NoJobsHere(const char* why);
  ~NoJobsHere();
  NoJobsHere(const NoJobsHere&) = delete;
  NoJobsHere& operator=(const NoJobsHere&) = delete;
};

/// A call that releases the interpreter's lock, or runs Python code that may, as an import does; for its
/// lifetime. It is made and destroyed with that lock.
class RunningCall {
 public:
  /// Throws Error when the interpreter exits.
  explicit RunningCall(Progress& progress);
  ~RunningCall();
  RunningCall(const RunningCall&) = delete;
  RunningCall& operator=(const RunningCall&) = delete;

  /// Throws SystemExit when the interpreter exits, which ends a thread without a word.
  void check() const;

 private:
  Progress& progress_;
};

/// Cancels the calls of daemon threads and waits for them, with the interpreter's lock: when the interpreter
/// has gone, it ends such threads in the middle of a call, which aborts the process.
void end_running_calls();

/// Throws the Python exception of a signal that has come; on the main thread only, with the interpreter's
/// lock.
void check_signals();

}  // namespace xraycast::python
