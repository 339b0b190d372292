#include "drawing.hpp"

#include "calls/owning_process.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/drawing/headless_context.hpp"
#include "xraycast/drawing/renderer.hpp"

#include <condition_variable>
#include <exception>
#include <functional>
#include <future>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

namespace xraycast::python {
namespace {

/// A context and its renderer.
struct Canvas {
  HeadlessContext context;
  Renderer renderer;
};

/// The thread that draws; for one caller at a time.
class Drawing {
 public:
  Drawing() : thread_([this] { work(); }) {}
  ~Drawing() {
    {
      const std::lock_guard lock(mutex_);
      is_stopping_ = true;
      changed_.notify_all();
    }
    thread_.join();
  }
  Drawing(const Drawing&) = delete;
  Drawing& operator=(const Drawing&) = delete;

  void draw(const std::function<void(Renderer&)>& work) {
    std::packaged_task<void()> task([&] {
      if (!canvas_) canvas_.emplace();
      work(canvas_->renderer);
    });
    std::future<void> result = task.get_future();
    {
      std::unique_lock lock(mutex_);
      changed_.wait(lock, [&] { return !task_; });
      task_ = &task;
      changed_.notify_all();
    }
    result.get();
  }

 private:
  void work() {
    std::unique_lock lock(mutex_);
    for (;;) {
      changed_.wait(lock, [&] { return task_ || is_stopping_; });
      if (!task_) break;
      auto& task = *std::exchange(task_, nullptr);
      lock.unlock();
      task();
      lock.lock();
      changed_.notify_all();
    }
    canvas_.reset();
  }

  std::mutex mutex_;
  std::condition_variable changed_;
  std::packaged_task<void()>* task_ = nullptr;  ///< the next one, of a caller that waits
  bool is_stopping_ = false;
  std::optional<Canvas> canvas_;  ///< of the thread
  std::thread thread_;
};

OwningProcess drawing_owner;
std::mutex drawing_mutex;
/// Guarded by drawing_mutex. Destroyed by stop_drawing only: a forked process has not its thread.
Drawing* drawing = nullptr;

Drawing& the_drawing() {
  if (!drawing_owner.claim())
    throw Error(
        "frames were drawn before this process was forked, and cannot be drawn here; start processes by "
        "multiprocessing's method `spawn`");
  const std::lock_guard lock(drawing_mutex);
  if (!drawing) drawing = new Drawing;
  return *drawing;
}

}  // namespace

void draw(const std::function<void(Renderer&)>& work) { the_drawing().draw(work); }

void stop_drawing() {
  if (!drawing_owner.is_this()) return;
  const std::lock_guard lock(drawing_mutex);
  delete std::exchange(drawing, nullptr);
}

}  // namespace xraycast::python
