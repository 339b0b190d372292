#pragma once

#include "xraycast/casting/map_geometry.hpp"
#include "xraycast/volume/volume.hpp"

#include <string>

namespace xraycast {

/// Throws InputError, naming both, when a map cannot have been cast from a scan: it lies elsewhere, its rows
/// are not the scan's slices, or its rays went through another field of view.
void check_same_scan(const MapGeometry& map, const std::string& name, const VolumeGeometry& volume,
                     const std::string& scan);

/// The same for a map and its basis: both must have the same field of view or, if a file does not state it,
/// the same geometry. Layers and angles may differ.
void check_same_scan(const MapGeometry& map, const std::string& name, const MapGeometry& basis,
                     const std::string& basis_name);

}  // namespace xraycast
