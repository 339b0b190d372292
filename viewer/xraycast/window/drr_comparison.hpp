#pragma once

#include "xraycast/projection/projector.hpp"
#include "xraycast/window/latest_worker.hpp"
#include "xraycast/window/opened_files.hpp"

#include <functional>
#include <memory>
#include <optional>
#include <vector>

namespace xraycast {

/// DRRs of the scan, projected in the background, and the similarity of the map's frames to them.
class DrrComparison {
 public:
  /// `request_redraw` is called on other threads when there is a new result.
  explicit DrrComparison(const std::function<void()>& request_redraw);

  /// Projects a view, unless it was the last one requested.
  void request(const View& view, const Opacity& opacity,
               const std::shared_ptr<OpenedFiles::ScanOnDevice>& scan);

  /// Takes the results since the last call; true when there is a new DRR. Throws the errors of projecting and
  /// comparing.
  bool take_results();

  /// The latest DRR, which may be of an earlier view; null before the first.
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
