#include "xraycast/geometry/moved_vessels.hpp"

#include "xraycast/base/parallel.hpp"
#include "xraycast/base/pluralize.hpp"

#include <fmt/format.h>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <utility>

namespace xraycast {
namespace {

/// Returns how many points have no place.
std::int64_t move_branch(VesselBranch& branch, const HeldMotion& motion) {
  std::vector<VesselPoint>& points = branch.points;
  const std::vector<VesselPoint> rest = points;
  std::int64_t lost = 0;
  for (VesselPoint& point : points) {
    // From the place at rest for all, so that branches meet where they met.
    const InverseResult found = motion.inverse_mm(point.position_mm);
    if (found.is_found)
      point.position_mm = found.x_mm;
    else
      ++lost;
  }
  for (std::size_t i = 0; i < rest.size(); ++i) {
    const std::size_t before = i > 0 ? i - 1 : 0, after = std::min(i + 1, rest.size() - 1);
    const auto length_mm = [&](const std::vector<VesselPoint>& of) {
      return glm::distance(of[before].position_mm, of[after].position_mm);
    };
    const double growth =
        length_mm(rest) / length_mm(points) / glm::determinant(motion.jacobian(points[i].position_mm));
    // Where the motion folds there is none.
    if (growth > 0 && std::isfinite(growth)) points[i].radius_mm *= std::sqrt(growth);
  }
  return lost;
}

}  // namespace

MovedVessels<VesselTree> moved(const VesselTree& tree, const HeldMotion& motion) {
  std::vector<VesselBranch> branches = tree.branches();
  std::atomic<std::int64_t> lost = 0, points = 0;
  if (!motion.is_still())
    parallel_for(std::ssize(branches), [&](std::int64_t b) {
      VesselBranch& branch = branches[static_cast<std::size_t>(b)];
      points += std::ssize(branch.points);
      lost += move_branch(branch, motion);
    });
  return {VesselTree(std::move(branches), "the moved vessels"), {lost, points}};
}

MovedVessels<Mesh> moved(Mesh mesh, const HeldMotion& motion) {
  std::atomic<std::int64_t> lost = 0;
  constexpr std::int64_t kTogether = 256;
  const std::int64_t count = motion.is_still() ? 0 : std::ssize(mesh.points_mm);
  parallel_for((count + kTogether - 1) / kTogether, [&](std::int64_t block) {
    for (std::int64_t i = kTogether * block; i < std::min(count, kTogether * (block + 1)); ++i) {
      glm::vec3& point_mm = mesh.points_mm[static_cast<std::size_t>(i)];
      const InverseResult found = motion.inverse_mm(point_mm);
      if (found.is_found)
        point_mm = found.x_mm;
      else
        ++lost;
    }
  });
  return {std::move(mesh), {lost, count}};
}

std::vector<std::string> LostPoints::notes(const std::string& name) const {
  if (lost == 0) return {};
  return {
      fmt::format("{}: {} of {} have no place in the moved body, because the motion folds there; look at "
                  "them, or smooth the motion's fields",
                  name, lost, pluralize(of, "point"))};
}

}  // namespace xraycast
