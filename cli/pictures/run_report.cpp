#include "pictures/run_report.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace xraycast::cli {

std::string text_of(const std::vector<RunRecord>& last) {
  std::string text =
      fmt::format("tip: in branch {}, {:.0f} mm along it", last[0].tip.branch, last[0].tip.arc_length_mm);
  for (std::size_t d = 1; d < last.size(); ++d)
    text += fmt::format("; tip {}: in branch {}, {:.0f} mm along it", d + 1, last[d].tip.branch,
                        last[d].tip.arc_length_mm);
  return text;
}

std::vector<glm::vec3> points_of(const VesselTree& tree) {
  std::vector<glm::vec3> points_mm;
  for (const VesselBranch& branch : tree.branches())
    for (const VesselPoint& point : branch.points) points_mm.emplace_back(point.position_mm);
  return points_mm;
}

View no_smaller(View view, const BodyBounds& bounds) {
  constexpr int kMinPixels = 600;
  const int longest = std::max(view.width, view.height);
  if (longest >= kMinPixels) return view;
  view.pixel_mm *= static_cast<double>(longest) / kMinPixels;
  view.width = view.height = 0;
  return fitted(view, bounds);
}

}  // namespace xraycast::cli
