#include "xraycast/window/worker.hpp"

#include "xraycast/base/error.hpp"

#include <utility>

namespace xraycast {

Worker::~Worker() {
  cancel();
  if (thread_.joinable()) thread_.join();
}

void Worker::start(std::string name, Job job) {
  cancel();
  if (thread_.joinable()) thread_.join();
  name_ = std::move(name);
  progress_ = std::make_unique<Progress>([this](const Progress::State& state) {
    const std::lock_guard lock(mutex_);
    state_ = state;
  });
  state_ = {};
  delivery_ = {};
  error_ = nullptr;
  running_ = true;
  finished_ = false;
  thread_ = std::thread([this, job = std::move(job)] {
    Delivery delivery;
    std::exception_ptr error;
    try {
      delivery = job(*progress_);
      progress_->check();  // a job that was cancelled in its last step has no result either
    } catch (const Cancelled&) {
    } catch (...) {
      error = std::current_exception();
    }
    const std::lock_guard lock(mutex_);
    delivery_ = std::move(delivery);
    error_ = error;
    finished_ = true;
  });
}

void Worker::cancel() {
  if (progress_) progress_->cancel();
}

void Worker::poll() {
  {
    const std::lock_guard lock(mutex_);
    if (!running_ || !finished_) return;
    running_ = false;
  }
  thread_.join();
  const Delivery delivery = std::exchange(delivery_, {});
  if (delivery) delivery();
  if (const std::exception_ptr error = std::exchange(error_, nullptr)) std::rethrow_exception(error);
}

std::optional<Worker::Status> Worker::status() const {
  const std::lock_guard lock(mutex_);
  if (!running_) return std::nullopt;
  return Status{name_, state_.stage, state_.fraction()};
}

}  // namespace xraycast
