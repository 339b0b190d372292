#pragma once

#include "xraycast/base/progress.hpp"

#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

namespace xraycast {

/// Runs one long job at a time on a thread of its own, such as reading or casting. The job returns a function
/// that delivers its result on the window's thread.
class Worker {
 public:
  using Delivery = std::function<void()>;
  using Job = std::function<Delivery(Progress&)>;

  ~Worker();

  /// Starts a job; a running one is cancelled and joined first.
  void start(std::string name, Job job);

  void cancel();

  /// Delivers a finished job's result. Throws the job's exception; a cancelled job has no result. Poll it on
  /// the window's thread.
  void poll();

  /// The running job's progress; none when there is no job.
  struct Status {
    std::string name, stage;
    double fraction;
  };
  std::optional<Status> status() const;

 private:
  std::string name_;
  std::unique_ptr<Progress> progress_;
  std::thread thread_;
  mutable std::mutex mutex_;  ///< guards the following members
  Progress::State state_;
  bool running_ = false, finished_ = false;
  Delivery delivery_;
  std::exception_ptr error_;
};

}  // namespace xraycast
