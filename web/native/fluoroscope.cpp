// What a page's worker calls of the fluoroscope, which `./dev page` compiles to WebAssembly (docs/web.md).
// One is open at a time. Functions that can fail return null, or a line that says why and stays until the
// next call.
#include "calls.hpp"
#include "tube_beam.hpp"
#include "xraycast/acquisition/console.hpp"

#include <cstdint>
#include <emscripten/emscripten.h>
#include <optional>
#include <span>
#include <vector>

namespace {

using xraycast::page::failure_of, xraycast::page::numbers;

std::vector<float> rays;
std::optional<xraycast::FluoroscopyConsole> console;
std::optional<xraycast::WaterPath> path;
xraycast::DoseRecord skipped;  // of pulses that were given and not drawn

/// Pulses that a slow device does not draw are given all the same, with the technique of the one that it
/// draws.
void count_skipped(const xraycast::DoseRecord& before, double pulses) {
  const xraycast::DoseRecord now = console->dose();
  skipped.air_kerma_mGy += pulses * (now.air_kerma_mGy - before.air_kerma_mGy);
  skipped.dap_Gycm2 += pulses * (now.dap_Gycm2 - before.dap_Gycm2);
  skipped.fluoroscopy_s += pulses * (now.fluoroscopy_s - before.fluoroscopy_s);
  skipped.images += static_cast<long long>(pulses) * (now.images - before.images);
}

void tell() {
  const xraycast::DoseRecord dose = console->dose();
  const xraycast::Technique technique = console->technique();
  numbers = {1.0 * technique.kvp,
             technique.mas,
             console->kerma_rate(),
             dose.air_kerma_mGy + skipped.air_kerma_mGy,
             dose.dap_Gycm2 + skipped.dap_Gycm2,
             dose.fluoroscopy_s + skipped.fluoroscopy_s,
             static_cast<double>(dose.images + skipped.images),
             console->is_saturated() ? 1.0 : 0.0,
             console->is_masking() ? 1.0 : 0.0,
             console->has_angiogram() ? 1.0 : 0.0,
             console->shows_road_map() ? 1.0 : 0.0};
}

}  // namespace

extern "C" {

/// Takes the setup (viewer/xraycast/trainer/fluoroscope_setup.hpp).
EMSCRIPTEN_KEEPALIVE const char* fluoroscope_open() {
  return failure_of([] {
    xraycast::FluoroscopeSetup setup = xraycast::fluoroscope_setup_of(numbers);
    xraycast::set_page_beams(std::move(setup.beams));
    path.emplace(setup.water_per_mm);
    skipped = {};
    console.emplace(std::move(setup.options));
  });
}

/// Room for the optical depths of the next pulse, row 0 on top.
EMSCRIPTEN_KEEPALIVE float* fluoroscope_rays(std::size_t pixels) {
  rays.resize(pixels);
  return rays.data();
}

/// The dose level: 0 low, 1 normal, 2 cine.
EMSCRIPTEN_KEEPALIVE void fluoroscope_dose(int level) {
  for (int k = 0; k < 3 && console->options().dose != static_cast<xraycast::DoseLevel>(level); ++k)
    console->next_dose();
}

/// Opening between the blades in mm at the isocentre; a width of 0: they are open.
EMSCRIPTEN_KEEPALIVE const char* fluoroscope_blades(double width_mm, double height_mm) {
  return failure_of([&] {
    const auto [source_axis_mm, source_detector_mm] = console->options().c_arm.distances;
    const double larger = source_detector_mm / source_axis_mm;
    std::optional<xraycast::Collimation> blades;
    if (width_mm > 0) blades = xraycast::Collimation{larger * width_mm, larger * height_mm};
    console->collimate(blades);
  });
}

/// Of the display's range, 0 to 1.
EMSCRIPTEN_KEEPALIVE const char* fluoroscope_compression(double share) {
  return failure_of([&] { console->compress(share); });
}

EMSCRIPTEN_KEEPALIVE void fluoroscope_subtract(bool subtracts) { console->subtract(subtracts); }
EMSCRIPTEN_KEEPALIVE void fluoroscope_new_mask() { console->take_new_mask(); }
EMSCRIPTEN_KEEPALIVE void fluoroscope_road_map(bool shows) { console->show_road_map(shows); }
EMSCRIPTEN_KEEPALIVE void fluoroscope_maximum_opacification(bool shows) {
  console->shows_maximum_opacification = shows;
}

/// Masks of the phases of a mode of the body, see MaskMatching; a mode below 0: the mean of a few.
EMSCRIPTEN_KEEPALIVE void fluoroscope_match_masks(int mode, bool wraps, double cycle_s) {
  std::optional<xraycast::MaskMatching> matching;
  if (mode >= 0) matching = {.mode = static_cast<std::size_t>(mode), .wraps = wraps, .cycle_s = cycle_s};
  console->match_masks(matching);
}

/// A pulse through the rays. The room holds the numbers of its view (pulse_view_of), the pulses since the
/// last one that was drawn, the pause before it in s, below 0 where there was none, how fast the body moves,
/// and the phases of its modes. Then it holds voltage in kV, mAs, the rate of air kerma in mGy/min; air kerma
/// in mGy, dose-area product in Gy cm2, fluoroscopy time in s and recorded images of all pulses; and 1 where
/// the detector is saturated, a mask is taken, vessels were opacified, and their road map is shown.
EMSCRIPTEN_KEEPALIVE const char* fluoroscope_expose() {
  return failure_of([] {
    const std::span<const double> told = numbers;
    const double pulses = told[10], pause_s = told[11];
    console->set_motion_speed(told[12]);
    if (pause_s >= 0) console->is_due(false, pause_s);
    console->is_due(true, 0);
    const xraycast::DoseRecord before = console->dose();
    console->expose(rays, xraycast::pulse_view_of(told.first<10>()), *path, told.subspan(13));
    count_skipped(before, pulses - 1);
    tell();
  });
}

/// The picture of the last pulse: greys, and what the detector sent of it.
EMSCRIPTEN_KEEPALIVE const std::uint8_t* fluoroscope_image() { return console->image().data(); }
EMSCRIPTEN_KEEPALIVE const std::uint16_t* fluoroscope_codes() { return console->codes().data(); }

}  // extern "C"
