#pragma once

#include "xraycast/base/progress.hpp"
#include "xraycast/phantom/phantom.hpp"

#include <filesystem>

namespace xraycast {

/// Throws InputError for a phantom that cannot move or is held at a phase, and for a spacing that is not 0.5
/// to 50 mm or gives fields of more than 2 GiB.
void check_motion(const Phantom& phantom, double spacing_mm);

/// Writes how a phantom moves as `motion.json` of an existing folder, with fields of displacements at nodes
/// `spacing_mm` apart, one for each key phase of each mode, such as `breath_1.nrrd`. At the nodes they are
/// exact. Throws InputError as check_motion.
void write_motion(const Phantom& phantom, const std::filesystem::path& folder, double spacing_mm,
                  Progress& progress);

}  // namespace xraycast
