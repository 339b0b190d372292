#pragma once

#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/mask/mask.hpp"
#include "xraycast/segmentation/segment.hpp"
#include "xraycast/volume/volume.hpp"

#include <filesystem>
#include <string>

namespace xraycast::cli {

/// Measurements of a branch.
struct BranchFacts {
  double length_mm, mean_radius_mm;
  double mean_hu;  ///< of the scan along the centreline
};

/// One for each branch of a tree.
std::vector<BranchFacts> branch_facts(const VesselTree& tree, const Volume& volume);

/// The share of a tree's length along which the mean of five points stands out of what surrounds the vessel
/// by less than three standard deviations of the noise.
double weak_share(const VesselTree& tree, const Volume& volume, double noise_hu);

/// What a segmentation took for granted, and how sure it is, in a line.
std::string assumptions(const SegmentLog& log, const SegmentOptions& options, double weak_share);

/// A picture of the segmentation: the scan from the front and from the left (the mean of its CT numbers along
/// each ray) with the mask over it in red and the centrelines in yellow, and a table of the longest branches,
/// whose numbers are drawn at their middles unless they would cover a longer one's. Throws Error when the
/// disk is full.
/// `assumed` is a line below the title.
void write_vessel_report(const std::string& title, const std::string& assumed, const Volume& volume,
                         const Mask& mask, const VesselTree& tree, const std::filesystem::path& path);

}  // namespace xraycast::cli
