#pragma once

#include "xraycast/base/picture_file.hpp"
#include "xraycast/segmentation/vessels.hpp"

#include <string>

namespace xraycast {

/// "3 branches, 1 loop"
std::string counts_of(const Centrelines& centrelines);

/// A picture of the segmentation: the scan from the front and from the left (the mean of its CT numbers along
/// each ray) with the mask over it in red and the centrelines in yellow, and a table of the longest branches,
/// whose numbers are drawn at their middles unless they would cover a longer one's. Below the title with the
/// scan's name stand what was taken for granted, and how sure it is. Throws InputError for the vessels of
/// another scan.
RgbPicture vessel_report(const std::string& name, const Vessels& vessels, const SegmentRequest& request,
                         const Volume& volume);

/// The same of vessels that were given, with a line on their origin below the title: over the scan whose grid
/// their mask is on, or over black.
RgbPicture given_vessel_report(const std::string& name, const Vessels& vessels, const std::string& origin,
                               const Volume* scan);

}  // namespace xraycast
