#include "xraycast/reports/pressure_plot.hpp"

#include "xraycast/reports/plot.hpp"

#include <cstddef>

namespace xraycast {

RgbPicture pressure_plot(const Run& run, const std::vector<std::string>& names) {
  std::vector<Curve> curves{{"aorta", {}}};
  for (const std::string& name : names) curves.push_back({"tip of " + name, {}});
  for (const PressureSample& sample : run.pressures) {
    curves[0].points.emplace_back(sample.time_s, sample.aortic_mmHg);
    for (std::size_t d = 0; d < names.size(); ++d)
      curves[d + 1].points.emplace_back(sample.time_s, sample.tips_mmHg[d]);
  }
  return plot("Pressure of the blood", "time (s)", "mmHg", curves);
}

}  // namespace xraycast
