#pragma once

#include "xraycast/casting/projector.hpp"
#include "xraycast/window/latest_worker.hpp"
#include "xraycast/window/opened_files.hpp"

#include <functional>
#include <memory>
#include <optional>
#include <vector>

namespace xraycast {

/// DRRs of the scan, projected beside the window, and how similar the map's frames are to them.
class DrrComparison {
 public:
  /// `request_redraw` is called on other threads when there is something to take.
  explicit DrrComparison(const std::function<void()>& request_redraw);

  /// Projects a view, unless it was the last one that was asked for.
  void request(const View& view, const Opacity& opacity,
               const std::shared_ptr<OpenedFiles::ScanOnDevice>& scan);

  /// Takes what has been made since the last call; true when there is another DRR. Throws what projecting or
  /// comparing threw.
  bool take_results();

  /// The latest DRR, which may be of an earlier view; null: there is none yet.
  const ProjectionImage* latest() const { return latest_.get(); }

  /// Compares a frame of the map, height x width optical depths of the body in latest()'s view, to latest().
  void compare(std::vector<float> tau);

  /// Of the last comparison.
  std::optional<double> psnr_db() const { return psnr_db_; }

  /// Forgets the DRR and the request.
  void reset();

 private:
  struct Projection {
    View view;
    Opacity opacity;
    std::shared_ptr<OpenedFiles::ScanOnDevice> scan;
  };
  struct Comparison {
    std::vector<float> tau;
    std::shared_ptr<const ProjectionImage> drr;
  };

  std::shared_ptr<const ProjectionImage> latest_;
  std::optional<View> requested_view_;
  std::optional<Opacity> requested_opacity_;
  std::optional<double> psnr_db_;
  LatestWorker<Projection, std::shared_ptr<const ProjectionImage>> projecting_;
  LatestWorker<Comparison, double> comparing_;
};

}  // namespace xraycast
