#include "drawing.hpp"

#include "owning_process.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/drawing/headless_context.hpp"
#include "xraycast/drawing/renderer.hpp"
#include "xraycast/drawing/still_picture.hpp"

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

/// A context, its renderer, and the map that this has.
struct Canvas {
  HeadlessContext context;
  Renderer renderer;
  std::shared_ptr<const BodyMap> map;
};

/// The thread that draws; one frame at a time.
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

  /// What `draw` makes with a renderer that has the map, and no surfaces but those that it sets.
  void run(const std::shared_ptr<const BodyMap>& map, const std::function<void(Renderer&)>& draw) {
    std::packaged_task<void()> task([&] {
      if (!canvas_) canvas_.emplace();
      if (canvas_->map != map) canvas_->renderer.set_map(map);
      canvas_->map = map;
      canvas_->renderer.set_surfaces({});
      draw(canvas_->renderer);
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

std::vector<float> drawn_tau(const std::shared_ptr<const BodyMap>& map, const View& view) {
  std::vector<float> tau;
  the_drawing().run(map, [&](Renderer& renderer) { tau = renderer.tau(view, {}); });
  return tau;
}

std::string drawn_still(const ExportRequest& request) {
  std::string png;
  the_drawing().run(request.map, [&](Renderer& renderer) { png = still_png(renderer, request); });
  return png;
}

void stop_drawing() {
  if (!drawing_owner.is_this()) return;
  const std::lock_guard lock(drawing_mutex);
  delete std::exchange(drawing, nullptr);
}

}  // namespace xraycast::python
