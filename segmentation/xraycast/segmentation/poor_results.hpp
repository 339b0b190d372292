#pragma once

#include "xraycast/segmentation/centreline.hpp"

#include <optional>
#include <string>
#include <vector>

namespace xraycast {

/// What about a tree is unlike vessels, a line each with the field of SegmentRequest that helps: one branch
/// of a scan whose voxels are 3 mm and more, hundreds of branches, and dozens of loops. `grid` is the scan's,
/// `name` its name.
std::vector<std::string> poor_results(const Centrelines& centrelines, const VolumeGeometry& grid,
                                      const std::string& name);

/// The same of a tree that was found without any hint: one shorter in all than a third of the scan is long,
/// or nothing.
std::vector<std::string> too_little(const VesselTree& tree, const VolumeGeometry& grid,
                                    const std::string& name);

/// Of a tree whose root was not given: an end that is much wider than the root, or nothing. The heart's side
/// of a scan is often cut there.
std::vector<std::string> wider_end(const VesselTree& tree, const std::string& name);

/// Of a root that was given where no end is: how far the tree begins from it, or nothing.
std::vector<std::string> far_root(const VesselTree& tree, const std::optional<glm::dvec3>& root_mm,
                                  const std::string& name);

}  // namespace xraycast
