#pragma once

#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/sampling/c_arm_pose.hpp"
#include "xraycast/simulation/run.hpp"

#include <glm/vec3.hpp>

#include <string>
#include <vector>

namespace xraycast::cli {

/// Where the tips ended, by a run's last records.
std::string text_of(const std::vector<RunRecord>& last);

std::vector<glm::vec3> points_of(const VesselTree& tree);

/// The view with pixels so small that a catheter shows: the map of a coarse scan has too few.
View no_smaller(View view, const BodyBounds& bounds);

}  // namespace xraycast::cli
