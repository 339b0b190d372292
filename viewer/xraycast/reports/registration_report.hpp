#pragma once

#include "xraycast/base/picture_file.hpp"
#include "xraycast/phase_registration/motion_registration.hpp"

#include <filesystem>
#include <string>

namespace xraycast {

/// A picture of a motion that was made by registration: for each phase, a row, a coronal and a sagittal slice
/// of the phase less the reference, before and after, and its numbers. Grey is no difference; black and white
/// are -400 and 400 HU. `name` is the reference's.
RgbPicture registration_report(const std::string& name, const RegisteredMotion& motion);

/// Writes motion.json, its fields and report.png into a folder, which is created, all or none. Throws
/// InputError when they cannot be written and Error when the disk is full.
void write_registration(const RegisteredMotion& motion, const std::string& name,
                        const std::filesystem::path& folder, Progress& progress);

}  // namespace xraycast
