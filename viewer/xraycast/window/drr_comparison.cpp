#include "xraycast/window/drr_comparison.hpp"

#include "xraycast/requests/comparison.hpp"

#include <cstdint>
#include <utility>

namespace xraycast {

DrrComparison::DrrComparison(const std::function<void()>& request_redraw)
    : projecting_(
          [](const Projection& wanted) {
            Progress progress;
            return std::make_shared<const ProjectionImage>(
                project(wanted.scan->scan->native, wanted.view, wanted.opacity, progress));
          },
          request_redraw),
      comparing_(
          [](const Comparison& wanted) {
            const View& view = wanted.drr->view;
            const std::vector<std::uint8_t> all(wanted.tau.size(), 1);
            return xraycast::compare(wanted.tau, wanted.drr->tau, all, view.width, view.height).psnr_db;
          },
          request_redraw) {}

void DrrComparison::request(const View& view, const Opacity& opacity,
                            const std::shared_ptr<OpenedFiles::ScanOnDevice>& scan) {
  if (requested_view_ == view && requested_opacity_ == opacity) return;
  projecting_.ask({view, opacity, scan});
  requested_view_ = view;
  requested_opacity_ = opacity;
}

bool DrrComparison::take_results() {
  if (const auto psnr_db = comparing_.take()) psnr_db_ = *psnr_db;
  auto drr = projecting_.take();
  if (!drr) return false;
  latest_ = std::move(*drr);
  return true;
}

void DrrComparison::compare(std::vector<float> tau) { comparing_.ask({std::move(tau), latest_}); }

void DrrComparison::reset() {
  latest_.reset();
  requested_view_.reset();
  requested_opacity_.reset();
}

}  // namespace xraycast
