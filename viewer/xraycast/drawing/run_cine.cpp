#include "xraycast/drawing/run_cine.hpp"

#include "xraycast/drawing/brightness.hpp"
#include "xraycast/scene/catheter_surface.hpp"
#include "xraycast/scene/fluoroscopy_beam.hpp"
#include "xraycast/simulation/agent_outlet.hpp"

#include <algorithm>

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

RunCine::RunCine(std::shared_ptr<const BodyMap> map, const VesselTree& tree, const Options& options,
                 std::variant<Screen, Detector> taker)
    : tree_(tree),
      options_(options),
      taker_(std::move(taker)),
      bolus_(tree, options.blood),
      contrast_(tree),
      road_map_(tree),
      subtraction_(options.view.width, options.view.height) {
  renderer_.set_map(std::move(map));
  options_.style.window = automatic_window(renderer_, options_.view, options_.style);
  options_.style.full_contrast = true;
  subtraction_.shift_mask(options_.mask_shift);
}

void RunCine::see(const Instruments& devices, double time_s) {
  if (time_s < next_s_) return;
  const std::optional<std::size_t> outlet = agent_outlet(devices);
  inject(place_of(devices.tip(outlet.value_or(0))), outlet.has_value(), time_s);
  if (!is_in_run(time_s)) return;
  std::vector<glm::dvec3> nodes_mm;
  surfaces_ = 0;
  for (std::size_t d = 0; d < devices.count(); ++d) {
    devices.copy_nodes(d, nodes_mm);
    draw(nodes_mm, devices.rod(d).instrument());
  }
  take_frame();
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

bool RunCine::is_in_run(double time_s) const {
  return !options_.subtracts || time_s >= options_.injection.from_s - kMask_s;
}

bool RunCine::is_before_injection(double time_s) const {
  return time_s <= options_.injection.from_s || subtraction_.mask_frames() == 0;
}

/// Across the vessel at the tip, filled with the agent as the blood dilutes it.
double RunCine::opacified_tau(const VesselTree::Location& tip) const {
  const Injection& injection = options_.injection;
  const double diluted = std::min(1.0, injection.rate_ml_s / bolus_.mean_flow_ml_s(tip.branch));
  return 2 * radius_mm(tree_, tip) * fluoroscopy_per_mm("I", injection.agent_mg_ml * diluted);
}

void RunCine::draw(const std::vector<glm::dvec3>& nodes_mm, const InstrumentModel& instrument) {
  for (const Surface& surface : device_surfaces(nodes_mm, instrument))
    renderer_.replace_surface(surfaces_++, surface);
}

/// The contrast agent's surface follows the devices'.
void RunCine::take_frame() {
  if (options_.style.shading == ShadingMode::fluoro)
    renderer_.replace_surface(surfaces_, contrast_.filled(bolus_.iodine_mg_ml()));
  const auto* detector = std::get_if<Detector>(&taker_);
  if (detector || options_.subtracts) {
    std::vector<float> tau = renderer_.tau(options_.view, options_.style);
    if (!detector && options_.measure) tau = options_.measure(tau);
    if (options_.subtracts && is_before_injection(last_s_)) subtraction_.add_to_mask(tau);
    if (detector) return (*detector)(std::move(tau));
    return std::get<Screen>(taker_)(subtracted(tau));
  }
  std::vector<std::uint8_t> rgb = renderer_.picture(options_.view, options_.style);
  draw_outline(road_map_.outline(options_.view), kRoadMapColour, options_.view.width, rgb);
  std::get<Screen>(taker_)(std::move(rgb));
}

std::vector<std::uint8_t> RunCine::subtracted(const std::vector<float>& tau) {
  std::vector<float> difference(tau.size());
  subtraction_.subtract(tau, difference);
  if (!options_.shows_maximum_opacification) return subtraction_picture(difference, window_);
  opacified_.add(difference);
  return subtraction_picture(opacified_.picture(), window_);
}

}  // namespace xraycast
