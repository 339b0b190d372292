#pragma once

#include "xraycast/casting/body_map.hpp"
#include "xraycast/motion/motion.hpp"

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

namespace xraycast {

/// By which vessels and walls move with a map that does: the file that is given, else the one by which the
/// map was cast, as it names it. Null where the map stands still, and where none is given and the map's file
/// is not there any more; a note tells of the latter, and of the motion's warnings. Throws InputError as
/// read_motion, and where the motion has other modes than the map.
std::shared_ptr<const Motion> motion_of(const BodyMap& map, const std::filesystem::path& given,
                                        std::vector<std::string>& notes);

}  // namespace xraycast
