#include "xraycast/drawing/run_cine.hpp"

#include "xraycast/drawing/brightness.hpp"
#include "xraycast/scene/catheter_surface.hpp"

namespace xraycast {
RunCine::RunCine(std::shared_ptr<const BodyMap> map, const VesselTree& tree, const Options& options,
                 std::variant<Screen, Detector> taker)
    : options_(options), taker_(std::move(taker)), bolus_(tree), contrast_(tree), road_map_(tree) {
  renderer_.set_map(std::move(map));
  options_.style.window = automatic_window(renderer_, options_.view, options_.style);
  options_.style.full_contrast = true;
}

void RunCine::see(const Catheter& catheter, double time_s) {
  if (!is_due(time_s)) return;
  inject(catheter.tip(), true, time_s);
  std::vector<glm::dvec3> nodes_mm;
  catheter.copy_nodes(nodes_mm);
  renderer_.replace_surface(0, catheter_surface(nodes_mm, catheter.rod().instrument().radius_mm()));
  draw_contrast(1);
  take_frame();
}

void RunCine::see(const CoaxialCatheters& devices, double time_s) {
  if (!is_due(time_s)) return;
  inject(devices.tip(0), devices.has_free_lumen(0), time_s);
  std::vector<glm::dvec3> nodes_mm;
  for (std::size_t d = 0; d < devices.count(); ++d) {
    devices.copy_nodes(d, nodes_mm);
    renderer_.replace_surface(d, catheter_surface(nodes_mm, devices.rod(d).instrument().radius_mm()));
  }
  draw_contrast(devices.count());
  take_frame();
}

void RunCine::inject(const CatheterTip& tip, bool has_free_lumen, double time_s) {
  const bool injects = has_free_lumen && last_s_ >= options_.inject_from_s && last_s_ < options_.inject_to_s;
  bolus_.step(time_s - last_s_, place_of(tip), injects ? options_.injection_ml_s : 0);
  last_s_ = time_s;
  next_s_ += options_.step_s;
}

/// Its surface follows the devices'.
void RunCine::draw_contrast(std::size_t devices) {
  if (options_.style.shading == ShadingMode::fluoro)
    renderer_.replace_surface(devices, contrast_.filled(bolus_.iodine_mg_ml()));
}

void RunCine::take_frame() {
  if (const auto* detector = std::get_if<Detector>(&taker_))
    return (*detector)(renderer_.tau(options_.view, options_.style));
  std::vector<std::uint8_t> rgb = renderer_.picture(options_.view, options_.style);
  draw_outline(road_map_.outline(options_.view), kRoadMapColour, options_.view.width, rgb);
  std::get<Screen>(taker_)(std::move(rgb));
}

}  // namespace xraycast
