#include "xraycast/acquisition/run_cine.hpp"

#include "xraycast/drawing/brightness.hpp"
#include "xraycast/scene/catheter_surface.hpp"
#include "xraycast/scene/fluoroscopy_beam.hpp"
#include "xraycast/scene/same_scan.hpp"
#include "xraycast/simulation/agent_outlet.hpp"

#include <algorithm>
#include <cmath>

namespace xraycast {
namespace {

/// Of the point of the tree at a place or next beyond it.
double radius_mm(const VesselTree& tree, const VesselTree::Location& place) {
  const VesselBranch& branch = tree.branches()[static_cast<std::size_t>(place.branch)];
  const auto beyond = std::ranges::lower_bound(branch.arc_length_mm, place.arc_length_mm);
  return branch
      .points[static_cast<std::size_t>(
          std::min(beyond - branch.arc_length_mm.begin(), std::ssize(branch.points) - 1))]
      .radius_mm;
}

}  // namespace

View no_smaller(View view, const BodyBounds& bounds) {
  constexpr int kMinPixels = 600;
  const int longest = std::max(view.width, view.height);
  if (longest >= kMinPixels) return view;
  view.pixel_mm *= static_cast<double>(longest) / kMinPixels;
  view.width = view.height = 0;
  return fitted(view, bounds);
}

RunCine::RunCine(std::shared_ptr<const BodyMap> map, const VesselTree& tree, const Options& options)
    : tree_(tree),
      options_(options),
      acquisition_(options.picture.acquisition, options.view,
                   path_of(map->attenuation, options.picture.acquisition)),
      bolus_(tree, options.blood),
      contrast_(tree),
      road_map_(tree) {
  if (options.motion) {
    check_same_modes(*map, *options.motion);
    Progress progress;
    contrast_points_.emplace(contrast_.whole().mesh.points_mm, *options.motion, progress);
  }
  renderer_.set_map(std::move(map));
  if (const auto& fluoroscope = options.picture.acquisition.fluoroscope)
    options_.step_s = 1 / fluoroscope->pulses_per_s;
  Style& style = options_.picture.style;
  style.window = automatic_window(renderer_, options_.view, style);
  style.full_contrast = true;
}

bool RunCine::advance(const Instruments& instruments, double time_s) {
  if (time_s <= 0 || time_s < next_s_) return false;
  const std::optional<std::size_t> outlet = agent_outlet(instruments);
  inject(place_of(instruments.tip(outlet.value_or(0))), outlet.has_value(), time_s);
  if (time_s < begin_s()) return false;
  place(instruments);
  return true;
}

double RunCine::begin_s() const {
  return options_.picture.acquisition.subtracts ? std::max(options_.injection.from_s - kMask_s, 0.0) : 0;
}

std::int64_t RunCine::most_frames(double longest_s) const {
  return static_cast<std::int64_t>(std::ceil((longest_s - begin_s()) / options_.step_s)) + 1;
}

/// Lets the blood flow on to a frame's time.
void RunCine::inject(const VesselTree::Location& tip, bool is_lumen_free, double time_s) {
  if (time_s > last_s_) {
    const double rate_ml_s = options_.injection.mean_rate_ml_s(last_s_, time_s);
    (is_lumen_free ? injected_ml_ : withheld_ml_) += rate_ml_s * (time_s - last_s_);
    bolus_.step(time_s - last_s_, tip, is_lumen_free ? rate_ml_s : 0, options_.injection.agent_mg_ml);
  }
  last_s_ = time_s;
  next_s_ += options_.step_s;
  if (is_before_injection(time_s)) window_.black = opacified_tau(tip);
}

bool RunCine::is_before_injection(double time_s) const {
  return time_s <= options_.injection.from_s || acquisition_.mask_frames() == 0;
}

/// Across the vessel at the tip, filled with the agent as the blood dilutes it.
double RunCine::opacified_tau(const VesselTree::Location& tip) const {
  const Injection& injection = options_.injection;
  const double diluted = std::min(1.0, injection.rate_ml_s / bolus_.mean_flow_ml_s(tip.branch));
  return 2 * radius_mm(tree_, tip) * fluoroscopy_per_mm("I", injection.agent_mg_ml * diluted);
}

/// The contrast agent's surface follows the instruments'.
void RunCine::place(const Instruments& instruments) {
  const std::span<const double> phases = instruments.phases();
  if (!phases.empty()) renderer_.set_phases(phases);
  std::vector<glm::dvec3> nodes_mm;
  std::size_t surfaces = 0;
  for (std::size_t d = 0; d < instruments.count(); ++d) {
    instruments.copy_nodes(d, nodes_mm);
    for (const Surface& surface : instrument_surfaces(nodes_mm, instruments.rod(d).instrument()))
      renderer_.replace_surface(surfaces++, surface);
  }
  if (options_.picture.style.look != Look::fluoro) return;
  renderer_.replace_surface(surfaces,
                            contrast_points_ && !phases.empty()
                                ? contrast_.filled(bolus_.iodine_mg_ml(), contrast_points_->at(phases))
                                : contrast_.filled(bolus_.iodine_mg_ml()));
}

const AcquiredFrame& RunCine::frame() {
  tau_ = renderer_.tau(options_.view, options_.picture.style);
  return acquisition_.expose(
      tau_, options_.view, is_before_injection(last_s_) ? Acquisition::Use::mask : Acquisition::Use::filled);
}

std::vector<std::uint8_t> RunCine::picture() {
  const AcquisitionOptions& acquired = options_.picture.acquisition;
  if (acquired.subtracts) return subtraction_picture(frame().difference, window_);
  if (acquired.fluoroscope) return rgb_of(frame().pulse->shown);
  std::vector<std::uint8_t> rgb = renderer_.picture(options_.view, options_.picture.style);
  draw_outline(road_map_.outline(options_.view), kRoadMapColour, options_.view.width, rgb);
  return rgb;
}

}  // namespace xraycast
