#pragma once

#include <condition_variable>
#include <exception>
#include <functional>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

namespace xraycast {

/// Serves the latest of a stream of requests on a thread of its own: a request that is still waiting when the
/// next one comes is dropped. For pictures that follow a moving pose.
template <typename Request, typename Result>
class LatestWorker {
 public:
  using Work = std::function<Result(const Request&)>;

  /// `notify` is called on the worker's thread when there is a new result.
  LatestWorker(Work work, std::function<void()> notify)
      : work_(std::move(work)), notify_(std::move(notify)), thread_([this] { run(); }) {}
  ~LatestWorker() {
    {
      const std::lock_guard lock(mutex_);
      ends_ = true;
    }
    changed_.notify_one();
    thread_.join();
  }
  LatestWorker(const LatestWorker&) = delete;
  LatestWorker& operator=(const LatestWorker&) = delete;

  void ask(Request request) {
    {
      const std::lock_guard lock(mutex_);
      request_ = std::move(request);
    }
    changed_.notify_one();
  }

  /// The result since the last call, if any. Throws what the work threw.
  std::optional<Result> take() {
    const std::lock_guard lock(mutex_);
    if (const std::exception_ptr error = std::exchange(error_, nullptr)) std::rethrow_exception(error);
    return std::exchange(result_, std::nullopt);
  }

 private:
  void run() {
    while (true) {
      std::unique_lock lock(mutex_);
      changed_.wait(lock, [this] { return ends_ || request_; });
      if (ends_) return;
      const Request request = std::move(*std::exchange(request_, std::nullopt));
      lock.unlock();
      std::optional<Result> result;
      std::exception_ptr error;
      try {
        result = work_(request);
      } catch (...) {
        error = std::current_exception();
      }
      lock.lock();
      result_ = std::move(result);
      error_ = error;
      lock.unlock();
      notify_();
    }
  }

  Work work_;
  std::function<void()> notify_;
  std::mutex mutex_;  ///< guards the following members
  std::condition_variable changed_;
  bool ends_ = false;
  std::optional<Request> request_;
  std::optional<Result> result_;
  std::exception_ptr error_;
  std::thread thread_;  ///< last: it uses all of the above
};

}  // namespace xraycast
