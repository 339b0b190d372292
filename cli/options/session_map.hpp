#pragma once

#include "options/command.hpp"
#include "xraycast/casting/body_map.hpp"
#include "xraycast/scene/session_file.hpp"

#include <memory>

namespace xraycast::cli {

/// The body map of a session, recast if the session has an opacity. Throws InputError, also for layer weights
/// of another number than the map's layers.
std::shared_ptr<const BodyMap> load_map(const ViewSession& scene, const Invocation& invocation);

}  // namespace xraycast::cli
