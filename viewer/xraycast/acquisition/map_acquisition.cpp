#include "xraycast/acquisition/map_acquisition.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/drawing/brightness.hpp"
#include "xraycast/scene/annotations.hpp"
#include "xraycast/scene/same_scan.hpp"

#include <fmt/ranges.h>

#include <algorithm>
#include <utility>

namespace xraycast {
namespace {

void check(const Style& style) {
  if (!std::ranges::all_of(style.layer_weights, [](float w) { return w >= 0 && w <= kMaxLayerWeight; }))
    throw InputError("`layer_weights` {}: each must be 0 to {:g}", fmt::join(style.layer_weights, ","),
                     kMaxLayerWeight);
  if (style.sampling.wall_radius_mm && style.sampling.compositing != Compositing::wall)
    throw InputError("`wall_radius_mm` {:g}: applies only to `compositing` wall; give that too",
                     *style.sampling.wall_radius_mm);
}

}  // namespace

void choose_look(const std::string& look, PictureOptions& options) {
  options.acquisition.subtracts = look == "dsa";
  if (look != "fluoro" && look != "surface" && look != "dsa")
    throw InputError("`look` {}: must be fluoro, surface or dsa", look);
  options.style.look = look == "surface" ? Look::surface : Look::fluoro;
}

void check(const PictureOptions& options, bool has_vessels, bool has_instruments) {
  const bool is_shaded = options.style.look == Look::surface, subtracts = options.acquisition.subtracts,
             has_pulses = options.acquisition.fluoroscope.has_value();
  check(options.style);
  if (options.style.full_contrast && (is_shaded || subtracts))
    throw InputError("`full_contrast` does not apply to `look` {}; leave it out",
                     subtracts ? "dsa" : "surface");
  if (options.style.full_contrast && has_pulses)
    throw InputError("`full_contrast` does not apply to a fluoroscope's picture; leave it out");
  if (is_shaded && has_pulses)
    throw InputError("`look` surface: a fluoroscope cannot show shaded surfaces; leave it out");
  if (is_shaded && !has_vessels && !has_instruments)
    throw InputError("`look` surface: there is nothing to shade; give `vessels` or `catheter` too");
  if (subtracts && !has_vessels)
    throw InputError("`look` dsa: there are no vessels with contrast agent; give `vessels` too");
}

MapAcquisition::MapAcquisition(Renderer& renderer, MapScene scene, const PictureOptions& options,
                               const View& first)
    : renderer_(renderer),
      scene_(std::move(scene)),
      options_(options),
      acquisition_(options.acquisition, first, path_of(scene_.map->attenuation, options.acquisition)) {
  check(options_, scene_.vessels.has_value(), !scene_.instruments.empty() || !scene_.implants.empty());
  if (scene_.road_map) road_map_.emplace(*scene_.road_map);
  renderer_.set_map(scene_.map);
  renderer_.set_implants(scene_.implants);
  Progress progress;
  if (scene_.motion) check_same_modes(*scene_.map, *scene_.motion);
  if (scene_.motion && scene_.vessels) moving_.emplace(*scene_.vessels, *scene_.motion, progress);
  show_vessels(true);
}

void MapAcquisition::set_phases(std::span<const double> phases) {
  renderer_.set_phases(phases);
  phases_.assign(phases.begin(), phases.end());
  if (!moving_) return;
  scene_.vessels->mesh.points_mm = moving_->at(phases).mesh.points_mm;
  renderer_.move_surface(0, scene_.vessels->mesh.points_mm);  // the first of those that are shown
}

void MapAcquisition::show_vessels(bool shows) {
  std::vector<Surface> surfaces;
  if (shows && scene_.vessels) surfaces.push_back(*scene_.vessels);
  surfaces.insert(surfaces.end(), scene_.instruments.begin(), scene_.instruments.end());
  renderer_.set_surfaces(surfaces);
}

const AcquiredFrame& MapAcquisition::frame(const View& view) {
  if (options_.acquisition.subtracts) {
    take_mask(view);
  }
  tau_ = renderer_.tau(view, options_.style);
  return acquisition_.expose(tau_, view);
}

void MapAcquisition::take_mask(const View& view) {
  std::vector<double> phases = phases_;
  const bool is_other = masks_ && masks_->phase && masks_->mode < phases.size();
  if (is_other) phases[masks_->mode] = *masks_->phase;
  if (is_other) renderer_.set_phases(phases);
  show_vessels(false);
  acquisition_.begin_mask();
  acquisition_.expose(renderer_.tau(view, options_.style), view, Acquisition::Use::mask);
  show_vessels(true);
  if (is_other) renderer_.set_phases(phases_);
}

std::vector<std::uint8_t> MapAcquisition::picture(const View& view) {
  const bool is_acquired = options_.acquisition.subtracts || options_.acquisition.fluoroscope;
  std::vector<std::uint8_t> rgb =
      is_acquired ? rgb_of(displayed(greys(view), options_.display)) : drawn(view);
  if (options_.has_annotations) annotate(rgb, view, bounds_of(scene_.map->geometry), label(view));
  if (road_map_) draw_outline(road_map_->outline(view), kRoadMapColour, view.width, rgb);
  return rgb;
}

std::vector<std::uint8_t> MapAcquisition::greys(const View& view) {
  const AcquiredFrame& taken = frame(view);
  if (!options_.acquisition.subtracts) return taken.pulse->shown;
  if (!window_) window_ = automatic_subtraction_window(taken.difference);
  return subtraction_greys(taken.difference, *window_);
}

std::vector<std::uint8_t> MapAcquisition::drawn(const View& view) {
  Style style = options_.style;
  if (!options_.has_window) style.window = automatic_window(renderer_, view, style);
  return renderer_.picture(view, style);
}

}  // namespace xraycast
