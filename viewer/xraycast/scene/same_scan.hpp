#pragma once

#include "xraycast/casting/map_geometry.hpp"
#include "xraycast/motion/motion_request.hpp"
#include "xraycast/volume/volume.hpp"

#include <string>
#include <vector>

namespace xraycast {

/// Throws InputError, naming both, when a map cannot have been cast from a scan: it lies elsewhere, its rows
/// are not the scan's slices, or its rays went through another field of view.
void check_same_scan(const MapGeometry& map, const std::string& name, const VolumeGeometry& volume,
                     const std::string& scan);

/// The same for a map and its basis: both must have the same field of view or, if a file does not state it,
/// the same geometry. Layers and angles may differ.
void check_same_scan(const MapGeometry& map, const std::string& name, const MapGeometry& basis,
                     const std::string& basis_name);

/// A warning when a map, by its source, was cast at another instant of the body's motion than that of what is
/// drawn into it; or none.
std::vector<std::string> notes_on_instant(const std::string& map_source, const MotionOfRequest& motion);

}  // namespace xraycast
