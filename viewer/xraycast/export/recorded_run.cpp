#include "xraycast/export/recorded_run.hpp"

#include "xraycast/export/packed_numbers.hpp"

#include <array>
#include <cmath>

namespace xraycast {

std::vector<glm::dvec3> controls_of(const std::vector<glm::dvec3>& nodes_mm) {
  std::vector<glm::dvec3> controls;
  constexpr std::size_t kFewest = 4;  // of a cubic
  if (nodes_mm.size() < kFewest) return controls;
  const NurbsCurve curve = curve_through(nodes_mm);
  for (const NurbsCurve::ControlPoint& point : curve.points()) controls.push_back(point.position_mm);
  return controls;
}

void RecordedRun::see(const CoaxialCatheters& devices, double time_s) {
  constexpr double kRounding_s = 1e-9;
  if (time_s < static_cast<double>(controls_mm.size()) * step_s - kRounding_s) return;
  std::vector<glm::dvec3> nodes_mm;
  devices.copy_nodes(0, nodes_mm);
  controls_mm.push_back(controls_of(nodes_mm));
  loads.push_back(devices.load(0));
}

std::string pack_shapes(const RecordedRun& run, double unit_mm) {
  using Steps = std::array<std::int64_t, 3>;
  PackedNumbers packed;
  std::vector<Steps> before;
  for (const std::vector<glm::dvec3>& controls_mm : run.controls_mm) {
    std::vector<Steps> steps;
    for (auto point = controls_mm.rbegin(); point != controls_mm.rend(); ++point)
      steps.push_back({std::llround(point->x / unit_mm), std::llround(point->y / unit_mm),
                       std::llround(point->z / unit_mm)});
    packed.add(static_cast<std::int64_t>(steps.size()));
    for (std::size_t i = 0; i < steps.size(); ++i) {
      const Steps from = i < before.size() ? before[i] : i > 0 ? steps[i - 1] : Steps{};
      for (std::size_t axis = 0; axis < 3; ++axis) packed.add(steps[i][axis] - from[axis]);
    }
    before = std::move(steps);
  }
  return packed.bytes();
}

}  // namespace xraycast
