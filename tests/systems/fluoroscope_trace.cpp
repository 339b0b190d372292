// PULSES TRACE: the program's fluoroscope, for comparison with a page's (fluoroscope_page_test.mjs). Takes
// pulses, one behind the other: 21 doubles, of which the first 12 are what web/native/fluoroscope.cpp takes
// and then dose level, blades' width (0: open) and height in mm, whether it subtracts, the compression of
// the display's range, whether it shows maximum opacification and a road map, the cycle in s by whose phases
// masks are matched (0: they are not), and the phase of the body's only mode; and optical depths as floats,
// row 0 on top. Writes of each pulse voltage, mAs, rate of air kerma, air kerma and dose-area product as
// doubles, its codes, and its greys.
#include "xraycast/acquisition/console.hpp"
#include "xraycast/fluoroscope/fluoroscope_request.hpp"
#include "xraycast/trainer/fluoroscope_setup.hpp"

#include <array>
#include <fstream>
#include <iostream>
#include <optional>
#include <span>
#include <vector>

namespace {

using Numbers = std::array<double, 21>;

template <typename Values>
void write(std::ofstream& file, const Values& values) {
  file.write(reinterpret_cast<const char*>(values.data()),
             static_cast<std::streamsize>(values.size() * sizeof(*values.data())));
}

template <typename Values>
bool read(std::ifstream& file, Values& values) {
  return static_cast<bool>(file.read(reinterpret_cast<char*>(values.data()),
                                     static_cast<std::streamsize>(values.size() * sizeof(*values.data()))));
}

void set(xraycast::FluoroscopyConsole& console, const Numbers& n) {
  while (console.options().dose != static_cast<xraycast::DoseLevel>(n[12])) console.next_dose();
  const std::optional<xraycast::Collimation> blades = console.options().collimation;
  const double width_mm = blades ? blades->width_mm : 0, height_mm = blades ? blades->height_mm : 0;
  if (n[13] == 0 && blades) console.collimate({});
  if (n[13] > 0 && (width_mm != n[13] || height_mm != n[14]))
    console.collimate(xraycast::Collimation{n[13], n[14]});
  if (console.options().range_compression() != n[16]) console.compress(n[16]);
  console.subtract(n[15] != 0);
  console.shows_maximum_opacification = n[17] != 0;
  if (console.shows_road_map() != (n[18] != 0)) console.show_road_map(n[18] != 0);
  if (console.mask_matching().has_value() != (n[19] > 0)) {
    std::optional<xraycast::MaskMatching> matching;
    if (n[19] > 0) matching = {.cycle_s = n[19]};
    console.match_masks(matching);
  }
}

}  // namespace

int main(int count, char** words) {
  constexpr double kWater_per_mm = 0.02;
  if (count != 3) return 2;
  try {
    xraycast::FluoroscopyConsole console(xraycast::options_of(xraycast::FluoroscopeRequest{}));
    const xraycast::WaterPath path(kWater_per_mm);
    std::ifstream pulses(words[1], std::ios::binary);
    std::ofstream trace(words[2], std::ios::binary);
    for (Numbers n{}; read(pulses, n);) {
      const xraycast::View view = xraycast::pulse_view_of(std::span(n).first<10>());
      std::vector<float> rays(static_cast<std::size_t>(view.width) * static_cast<std::size_t>(view.height));
      if (!read(pulses, rays)) return 1;
      set(console, n);
      if (n[11] >= 0) console.is_due(false, n[11]);
      console.is_due(true, 0);
      console.expose(rays, view, path, std::span(n).last<1>());
      const xraycast::DoseRecord dose = console.dose();
      write(trace, std::array{1.0 * console.technique().kvp, console.technique().mas, console.kerma_rate(),
                              dose.air_kerma_mGy, dose.dap_Gycm2});
      write(trace, console.codes());
      write(trace, console.image());
    }
    return trace.flush() ? 0 : 1;
  } catch (const std::exception& error) {
    std::cerr << error.what() << '\n';
    return 1;
  }
}
