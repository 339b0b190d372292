#include "xraycast/radii/measured_vessels.hpp"

#include "xraycast/radii/image_radii.hpp"
#include "xraycast/radii/longer_ends.hpp"
#include "xraycast/radii/lumen_of_lines.hpp"

#include <optional>
#include <utility>

namespace xraycast {
namespace {

/// What a scan shows of a contrast, if values are cut off; it lives as long as this.
class Shown {
 public:
  explicit Shown(const ScanOfTree& scan) : scan_{scan.volume, scan.noise_hu} {
    if (scan.shows_vessels_alone) response_.emplace(scan.volume, scan.noise_hu);
    if (response_ && response_->is_cut_off()) scan_.response = &*response_;
  }
  Shown(const Shown&) = delete;
  Shown& operator=(const Shown&) = delete;

  const ScanOfVessels& scan() const { return scan_; }

 private:
  std::optional<ScanResponse> response_;
  ScanOfVessels scan_;
};

}  // namespace

VesselTree measured_tree(const VesselTree& tree, const ScanOfTree& scan, const std::string& name,
                         Progress& progress) {
  return with_image_radii(tree, Shown(scan).scan(), name, progress).tree;
}

bool measure_and_follow(VesselTree& tree, Mask& mask, LumenFill& fill, const ScanOfTree& scan,
                        const std::string& name, Progress& progress) {
  const Shown shown(scan);
  auto [measured, brightness] = with_image_radii(tree, shown.scan(), name, progress);
  tree = std::move(measured);
  if (!brightness) return false;
  auto [longer, followed] = with_longer_ends(tree, shown.scan(), *brightness, name, progress);
  if (followed.empty()) return false;
  tree = std::move(longer);
  add_lumen_of_lines(followed, mask, fill);
  return true;
}

}  // namespace xraycast
