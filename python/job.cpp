#include "job.hpp"

#include "values.hpp"
#include "xraycast/opencl/failure_in_words.hpp"

#include <chrono>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <thread>

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
  return failure;
}

}  // namespace

void check_signals() {
  if (PyErr_CheckSignals() != 0) throw nb::python_error();
}

void run_job(const nb::object& listener, const std::function<void(Progress&)>& work) {
  const nb::object told = listening(listener);
  Mailbox mailbox;
  Progress progress([&](const Progress::State& state) { mailbox.put(state); });
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
  if (!told.is_none()) told.attr("close")();
  if (interruption) std::rethrow_exception(interruption);
  if (mailbox.failure()) std::rethrow_exception(mailbox.failure());
}

}  // namespace xraycast::python
