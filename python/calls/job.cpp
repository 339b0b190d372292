#include "calls/job.hpp"

#include "calls/values.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/opencl/failure_in_words.hpp"

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <exception>
#include <map>
#include <mutex>
#include <thread>
#include <unistd.h>

namespace xraycast::python {
namespace {

/// How often the calling thread looks for signals.
constexpr std::chrono::milliseconds kInterval{50};

/// What the worker tells the calling thread.
class Mailbox {
 public:
  void put(const Progress::State& state) {
    const std::lock_guard lock(mutex_);
    latest_ = state;
    changed_.notify_one();
  }
  void finish(std::exception_ptr failure) {
    const std::lock_guard lock(mutex_);
    failure_ = std::move(failure);
    is_done_ = true;
    changed_.notify_one();
  }
  /// Waits for a while for the end of the work, or for news.
  std::optional<Progress::State> wait(bool is_listening) {
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, kInterval, [&] { return is_done_ || (is_listening && latest_); });
    return std::exchange(latest_, std::nullopt);
  }
  std::optional<Progress::State> rest() {
    const std::lock_guard lock(mutex_);
    return std::exchange(latest_, std::nullopt);
  }
  bool is_done() const {
    const std::lock_guard lock(mutex_);
    return is_done_;
  }
  std::exception_ptr failure() const { return failure_; }  ///< once it is done

 private:
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::optional<Progress::State> latest_;
  std::exception_ptr failure_;
  bool is_done_ = false;
};

std::exception_ptr failure_of(const std::function<void(Progress&)>& work, Progress& progress) {
  try {
    try {
      work(progress);
      return nullptr;
    } catch (...) {
      rethrow_in_words();
    }
  } catch (...) {
    return std::current_exception();
  }
}

nb::object listening(const nb::object& listener) {
  if (listener.is_none()) return listener;
  return nb::module_::import_("xraycast._progress").attr("listener_of")(listener);
}

void tell(const nb::object& listener, const Progress::State& state) {
  listener(text_object(state.stage), state.done, state.total, text_object(state.unit));
}

/// Tells the listener and looks for signals until the work is done. Returns the exception of either.
std::exception_ptr watch(Mailbox& mailbox, Progress& progress, const nb::object& listener) {
  std::exception_ptr failure;
  while (!mailbox.is_done()) {
    std::optional<Progress::State> state;
    {
      const nb::gil_scoped_release released;
      state = mailbox.wait(!listener.is_none());
    }
    if (failure) continue;
    try {
      if (state && !listener.is_none()) tell(listener, *state);
      check_signals();
    } catch (...) {
      failure = std::current_exception();
      progress.cancel();
    }
  }
  if (failure || listener.is_none()) return failure;
  try {
    if (const auto state = mailbox.rest()) tell(listener, *state);
  } catch (...) {
    failure = std::current_exception();
  }
  return failure;
}

/// An exception of close() does not replace the call's.
void close(const nb::object& listener, bool has_failed) {
  if (listener.is_none()) return;
  try {
    listener.attr("close")();
  } catch (...) {
    if (!has_failed) throw;
  }
}

/// Guarded by the interpreter's lock, as is_exiting. Each with its process: a forked one has not its
/// parent's.
std::map<Progress*, pid_t> running;
bool is_exiting = false;

bool is_running_here() {
  return std::ranges::any_of(running, [](const auto& call) { return call.second == getpid(); });
}

thread_local const char* why_no_jobs = nullptr;

}  // namespace

NoJobsHere::NoJobsHere(const char* why) { why_no_jobs = why; }
NoJobsHere::~NoJobsHere() { why_no_jobs = nullptr; }

RunningCall::RunningCall(Progress& progress) : progress_(progress) {
  if (is_exiting) throw Error("the interpreter is exiting; make calls before");
  running[&progress_] = getpid();
}

RunningCall::~RunningCall() { running.erase(&progress_); }

void RunningCall::check() const {
  if (!is_exiting) return;
  PyErr_SetNone(PyExc_SystemExit);
  throw nb::python_error();
}

void end_running_calls() {
  is_exiting = true;
  for (const auto& [progress, process] : running)
    if (process == getpid()) progress->cancel();
  while (is_running_here()) {
    const nb::gil_scoped_release released;
    std::this_thread::sleep_for(kInterval / 10);
  }
}

void check_signals() {
  if (PyErr_CheckSignals() != 0) throw nb::python_error();
}

void run_job(const nb::object& listener, const std::function<void(Progress&)>& work) {
  if (why_no_jobs) throw InputError("{}", why_no_jobs);
  Mailbox mailbox;
  Progress progress([&](const Progress::State& state) { mailbox.put(state); });
  const RunningCall call(progress);
  const nb::object told = listening(listener);
  std::thread worker;
  try {
    worker = std::thread([&] { mailbox.finish(failure_of(work, progress)); });
  } catch (...) {
    rethrow_in_words();
  }
  const std::exception_ptr interruption = watch(mailbox, progress, told);
  {
    const nb::gil_scoped_release released;
    worker.join();
  }
  close(told, interruption || mailbox.failure());
  if (mailbox.failure()) call.check();
  if (interruption) std::rethrow_exception(interruption);
  if (mailbox.failure()) std::rethrow_exception(mailbox.failure());
}

}  // namespace xraycast::python
