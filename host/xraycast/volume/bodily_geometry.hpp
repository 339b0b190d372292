#pragma once

#include "xraycast/volume/volume.hpp"

#include <string>

namespace xraycast {

/// Throws InputError, with `name` in front, for voxels, an extent or a place that no body has, from micro-CT
/// to long tables: steps that follow would take any memory and time for them.
void require_bodily(const VolumeGeometry& grid, const std::string& name);

}  // namespace xraycast
