#pragma once

#include "xraycast/casting/body_map.hpp"
#include "xraycast/scene/session_file.hpp"

#include <memory>
#include <string>

namespace xraycast {

/// The body map of a session, recast on an OpenCL device (see ComputeDevice) if the session has an opacity.
/// Throws InputError, also for layer weights of another number than the map's layers.
std::shared_ptr<const BodyMap> load_map(const ViewSession& session, const std::string& device);

}  // namespace xraycast
