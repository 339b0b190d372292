#include "xraycast/scene/pulse_blur.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <utility>

namespace xraycast {
namespace {

bool moves_visibly(const Surface& first, const Surface& last, double pixel_mm) {
  constexpr double kVisible_px = 0.5;
  const auto& from = first.mesh.points_mm;
  const auto& to = last.mesh.points_mm;
  if (from.size() != to.size()) return false;
  const auto far = static_cast<float>(kVisible_px * pixel_mm);
  for (std::size_t p = 0; p < from.size(); ++p)
    if (glm::distance(from[p], to[p]) > far) return true;
  return false;
}

}  // namespace

double pixel_at_axis_mm(const View& view) {
  return view.cone ? view.pixel_mm * view.cone->source_axis_mm / view.cone->source_detector_mm
                   : view.pixel_mm;
}

std::vector<glm::dvec3> moved_on(std::span<const glm::dvec3> points_mm, std::span<const glm::dvec3> before_mm,
                                 double passed_s, double later_s) {
  std::vector<glm::dvec3> moved(points_mm.begin(), points_mm.end());
  if (points_mm.size() != before_mm.size() || passed_s <= 0) return moved;
  for (std::size_t p = 0; p < moved.size(); ++p)
    moved[p] += later_s / passed_s * (points_mm[p] - before_mm[p]);
  return moved;
}

std::vector<Surface> seen_by_pulse(std::vector<Surface> first, std::vector<Surface> middle,
                                   std::vector<Surface> last, double pixel_mm) {
  const std::size_t count = middle.size();
  std::vector<Surface> seen = std::move(middle);
  seen.resize(kPulseSteps * count);
  for (std::size_t s = 0; s < count && s < first.size() && s < last.size(); ++s) {
    if (!moves_visibly(first[s], last[s], pixel_mm)) continue;
    seen[count + s] = std::move(first[s]);
    seen[2 * count + s] = std::move(last[s]);
    seen[count + s].pulse_steps = 1 << 0;
    seen[s].pulse_steps = 1 << 1;
    seen[2 * count + s].pulse_steps = 1 << 2;
  }
  return seen;
}

}  // namespace xraycast
