#pragma once

#include "xraycast/motion/motion.hpp"
#include "xraycast/volume/scan_info.hpp"

#include <memory>
#include <string>
#include <vector>

namespace xraycast {

/// Throws InputError, with `motion_name` in front, for displacements that lie elsewhere than the body, or
/// that end within it where they are not small. Returns, one line each, what of them is worth a look: body
/// that shows what lies beyond the scan.
std::vector<std::string> check_motion(const Volume& scan, const HeldMotion& motion,
                                      const std::string& motion_name);

/// The slices of a scan while its motion is held: on the same grid, each voxel has the CT number, trilinear,
/// of the place x + d(x) in the scan, and is air where that lies beyond the scan's outer voxel faces. Made as
/// they are read, on all cores.
std::unique_ptr<SliceSource> moved_slices(std::shared_ptr<const Volume> scan, HeldMotion motion,
                                          SliceSource::HuRange hu_range = {});

/// The same of a scan that was opened, which is read whole at once (stage "reading" of `progress`), with what
/// check_motion says of it among its warnings. A motion that is still gives the scan itself. Throws
/// InputError as check_motion, and as reading does.
Scan moved(Scan scan, const HeldMotion& motion, const std::string& motion_name, Progress& progress);

}  // namespace xraycast
