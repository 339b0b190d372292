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

/// One long job at a time beside the window: reading, casting. The job returns what has to be done with its
/// result on the window's thread.
class Worker {
 public:
  using Delivery = std::function<void()>;
  using Job = std::function<Delivery(Progress&)>;

  ~Worker();

  /// Starts a job; one that still runs is cancelled and waited for first.
  void start(std::string name, Job job);

  void cancel();

  /// Delivers a finished job's result. Throws what the job threw; a cancelled job is silent. To be called
  /// often, on the window's thread.
  void poll();

  /// What the running job is doing; none when there is none.
  struct Status {
    std::string name, stage;
    double fraction;
  };
  std::optional<Status> status() const;

 private:
  std::string name_;
  std::unique_ptr<Progress> progress_;
  std::thread thread_;
  mutable std::mutex mutex_;  ///< of what follows
  Progress::State state_;
  bool running_ = false, finished_ = false;
  Delivery delivery_;
  std::exception_ptr error_;
};

}  // namespace xraycast
