#pragma once

#include "xraycast/casting/body_map.hpp"
#include "xraycast/casting/map_geometry.hpp"
#include "xraycast/motion/motion_request.hpp"
#include "xraycast/volume/volume.hpp"

#include <filesystem>
#include <map>
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

/// Whether the source of a map may be this file or folder of a scan, which a reader knows as `format`: all of
/// their paths agree that both tell, from the file's name upwards. Sources are relative to the folder in
/// which a map was cast.
bool may_be_source(const std::string& source, const std::filesystem::path& scan, const std::string& format);

/// The phases by mode, those at 0 left out, that the source of a map or scan names behind it, as those of an
/// instant do (Casting::describe): `scan.nrrd, breath 1, heart 0`. Empty for one at rest.
std::map<std::string, double> instant_of(const std::string& source);

/// Throws InputError, naming both, when a map that stands still shows the body at another instant than
/// `other`, a scan or vessels, whose source this is.
void check_same_instant(const BodyMap& map, const std::string& name, const std::string& other);

/// Throws InputError, naming the motion, unless the map stands still or moves by the motion's modes, in the
/// same order: phases of the one are then those of the other.
void check_same_modes(const BodyMap& map, const Motion& motion);

}  // namespace xraycast
