#include "xraycast/acquisition/run_cine.hpp"

#include "xraycast/blood_flow/vessel_impedance.hpp"
#include "xraycast/contrast_agent/agent_outlet.hpp"
#include "xraycast/drawing/brightness.hpp"
#include "xraycast/scene/catheter_surface.hpp"
#include "xraycast/scene/device_surface.hpp"
#include "xraycast/scene/fluoroscopy_beam.hpp"
#include "xraycast/scene/same_scan.hpp"
#include "xraycast/simulation/coiling.hpp"
#include "xraycast/simulation/instrument_pressures.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace xraycast {
namespace {

double healthy_radius_mm(const VesselTree& tree, const VesselTree::Location& place) {
  VesselBranch branch = tree.branches()[static_cast<std::size_t>(place.branch)];
  const std::vector<double> healthy_mm = healthy_radii_mm(branch);
  for (std::size_t k = 0; k < branch.points.size(); ++k) branch.points[k].radius_mm = healthy_mm[k];
  return point_at(branch, place.arc_length_mm).radius_mm;
}

double pulse_s(const AcquisitionOptions& options) {
  return options.fluoroscope ? 1e-3 * options.fluoroscope->c_arm.tube.pulse_ms : 0;
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
      road_map_(tree),
      next_s_(exposure_time_s(options.body, 0)) {
  if (const auto& motion = options.body.motion) {
    check_same_modes(*map, *motion);
    Progress progress;
    contrast_points_.emplace(contrast_.whole().mesh.points_mm, *motion, progress);
  }
  if (const auto& fluoroscope = options.picture.acquisition.fluoroscope) {
    options_.step_s = 1 / fluoroscope->pulses_per_s;
    // The body of each pulse is drawn anew.
    if (options.body.motion && map->keys) options_.picture.style.pixels_per_column = kLivePixelsPerColumn;
  }
  renderer_.set_map(std::move(map));
  renderer_.set_implants(options.implants);
  if (options.black) window_.black = *options.black;
  blur_ = {.pulse_s = pulse_s(options.picture.acquisition), .pixel_mm = pixel_at_axis_mm(options.view)};
  Style& style = options_.picture.style;
  style.window = automatic_window(renderer_, options_.view, style);
  style.full_contrast = true;
}

bool RunCine::advance(const Instruments& instruments, double time_s) {
  const bool takes = takes_frame(instruments, time_s);
  remember(instruments, time_s);
  return takes;
}

bool RunCine::takes_frame(const Instruments& instruments, double time_s) {
  const bool exposes = is_exposed(time_s);
  if (time_s <= 0 || !(exposes || time_s >= next_flow_s_)) return false;
  take_walls(instruments);
  take_coils(instruments, bolus_);
  bolus_.flow().fill(fillings_of(tree_, instruments));
  inject(instruments, time_s);
  if (!exposes || time_s < begin_s()) return false;
  note_r_wave(time_s);
  acquisition_.set_phases(instruments.phases());
  place(instruments, time_s);
  return true;
}

void RunCine::note_r_wave(double time_s) {
  has_r_wave_ = has_r_wave_between(options_.body, last_frame_s_, time_s);
  last_frame_s_ = time_s;
}

/// A frame is due, and the gate open. The next one is due a pulse later, or with a gate after this one.
bool RunCine::is_exposed(double time_s) {
  if (time_s <= 0 || time_s < next_s_) return false;
  next_s_ = options_.body.gate ? exposure_time_s(options_.body, time_s + options_.step_s)
                               : next_s_ + options_.step_s;
  return true;
}

double RunCine::begin_s() const {
  const AcquisitionOptions& acquired = options_.picture.acquisition;
  if (!acquired.subtracts) return 0;
  const auto& matching = acquired.mask_matching;
  const double cycle_s =
      matching && options_.body.speed > 0 ? matching->cycle_s / options_.body.speed + options_.step_s : 0;
  return std::max(options_.injection.from_s - std::max(kMask_s, cycle_s), 0.0);
}

std::int64_t RunCine::most_frames(double longest_s) const {
  return static_cast<std::int64_t>(std::ceil((longest_s - begin_s()) / options_.step_s)) + 1;
}

/// Lets the blood flow on to a frame's time.
void RunCine::inject(const Instruments& instruments, double time_s) {
  const std::optional<std::size_t> outlet = agent_outlet(instruments);
  const VesselTree::Location tip = location_of(instruments.tip(outlet.value_or(0)));
  if (time_s > last_s_) {
    const Injection& injection = options_.injection;
    const double rate_ml_s = outlet ? injection.mean_rate_ml_s(last_s_, time_s) : 0;
    bolus_.step(time_s - last_s_, tip, rate_ml_s, injection.agent_mg_ml,
                injection.particles.through(agent_lumen_mm(instruments)));
  }
  last_s_ = time_s;
  while (next_flow_s_ <= time_s) next_flow_s_ += options_.step_s;
  if (!options_.black && is_before_injection(time_s)) window_.black = opacified_tau(tip);
}

/// Where walls have yielded since the last frame.
void RunCine::take_walls(const Instruments& instruments) {
  if (instruments.vessel_changes() == vessel_changes_) return;
  vessel_changes_ = instruments.vessel_changes();
  const VesselTree widened = instruments.widened_tree();
  contrast_ = ContrastSurface(widened);
  bolus_.take_radii(widened);
  road_map_ = RoadMap(widened);
  if (!options_.body.motion) return;
  Progress progress;
  contrast_points_.emplace(contrast_.whole().mesh.points_mm, *options_.body.motion, progress);
}

bool RunCine::is_before_injection(double time_s) const {
  return time_s <= options_.injection.from_s || acquisition_.mask_frames() == 0;
}

/// See Options::black. As of the healthy vessel, films before and after a treatment have one window.
double RunCine::opacified_tau(const VesselTree::Location& tip) const {
  const Injection& injection = options_.injection;
  const double diluted = std::min(1.0, injection.rate_ml_s / bolus_.mean_flow_ml_s(tip.branch));
  return std::clamp(
      2 * healthy_radius_mm(tree_, tip) * fluoroscopy_per_mm("I", injection.agent_mg_ml * diluted),
      kLeastBlack, kMostBlack);
}

/// So much later, at which the script has another time: the contrast agent's surface follows the
/// instruments'.
std::vector<Surface> RunCine::surfaces_of(const Instruments& instruments, const std::vector<Surface>& left,
                                          double later_s, double time_s) {
  std::vector<glm::dvec3> nodes_mm;
  std::vector<Surface> surfaces;
  for (std::size_t d = 0; d < instruments.count(); ++d) {
    instruments.copy_nodes(d, nodes_mm);
    if (later_s != 0 && d < before_mm_.size())
      nodes_mm = moved_on(nodes_mm, before_mm_[d], time_s - before_s_, later_s);
    for (Surface& surface :
         instrument_surfaces(nodes_mm, instruments.rod(d).instrument(), treating_view(instruments, d)))
      surfaces.push_back(std::move(surface));
  }
  surfaces.insert(surfaces.end(), left.begin(), left.end());
  add_pushed_coils(instruments, surfaces);
  if (options_.picture.style.look != Look::fluoro) return surfaces;
  const std::vector<double> phases =
      later_s == 0 ? std::vector(instruments.phases().begin(), instruments.phases().end())
                   : phases_at(options_.body, time_s + later_s);
  surfaces.push_back(contrast_points_ && !phases.empty()
                         ? contrast_.filled(bolus_.iodine_mg_ml(), contrast_points_->at(phases))
                         : contrast_.filled(bolus_.iodine_mg_ml()));
  return surfaces;
}

/// Stents, and the coils in sacs, where the body shows them at the instant; a pulse does not blur them.
std::vector<Surface> RunCine::left_in_body(const Instruments& instruments) const {
  std::vector<DeviceTube> tubes = laid_coil_tubes(instruments);
  for (const PlacedStent& stent : instruments.treatments().stents())
    for (DeviceTube& tube : stent_tubes(stent, tree_)) tubes.push_back(std::move(tube));
  if (options_.body.motion && !instruments.phases().empty())
    move_into(options_.body.motion->held_at(instruments.phases()), tubes);
  return device_surfaces(tubes);
}

/// Those within their catheters.
void RunCine::add_pushed_coils(const Instruments& instruments, std::vector<Surface>& surfaces) const {
  std::vector<glm::dvec3> nodes_mm;
  for (std::size_t d = 0; d < instruments.count(); ++d)
    if (const std::optional<PushedCoil> pushed = instruments.pushed_coil(d)) {
      instruments.copy_nodes(pushed->around, nodes_mm);
      surfaces.push_back(device_surface(pushed_coil_tube(*pushed, nodes_mm)));
    }
}

void RunCine::place(const Instruments& instruments, double time_s) {
  if (!instruments.phases().empty()) renderer_.set_phases(instruments.phases());
  const std::vector<Surface> left = left_in_body(instruments);
  std::vector<Surface> surfaces = surfaces_of(instruments, left, 0, time_s);
  if (blur_.is_on()) {
    const double from_middle_s = blur_.from_middle_s();
    surfaces = seen_by_pulse(surfaces_of(instruments, left, -from_middle_s, time_s), std::move(surfaces),
                             surfaces_of(instruments, left, from_middle_s, time_s), blur_.pixel_mm);
  }
  if (surfaces.size() != placed_) renderer_.set_surfaces(surfaces);
  for (std::size_t s = 0; s < surfaces.size() && surfaces.size() == placed_; ++s)
    renderer_.replace_surface(s, surfaces[s]);
  placed_ = surfaces.size();
}

/// For the way of the instruments in a pulse.
void RunCine::remember(const Instruments& instruments, double time_s) {
  if (!blur_.is_on()) return;
  before_s_ = time_s;
  before_mm_.resize(instruments.count());
  for (std::size_t d = 0; d < instruments.count(); ++d) instruments.copy_nodes(d, before_mm_[d]);
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

RunUse RunCine::use() const {
  RunUse use{.contrast_ml = 0};  // see with_blood
  const std::optional<ExposureRecord> exposure = acquisition_.record();
  if (!exposure) return use;
  use.fluoroscopy_s = exposure->dose.fluoroscopy_s;
  use.exposures = exposure->dose.pulses;
  use.cine_runs = exposure->is_fluoroscopy ? 0 : 1;
  if (!exposure->has_dose) return use;
  use.air_kerma_mGy = exposure->dose.air_kerma_mGy;
  use.dap_Gycm2 = exposure->dose.dap_Gycm2;
  return use;
}

}  // namespace xraycast
