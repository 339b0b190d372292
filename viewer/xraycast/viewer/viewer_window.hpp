#pragma once

#include "xraycast/progress.hpp"
#include "xraycast/viewer/session_file.hpp"

#include <string>

namespace xraycast {

/// The interactive viewer, until its window is closed or `progress` cancelled. `device` chooses the OpenCL
/// device as for Device. Files of the session are read once the window is there. Throws Error when there is
/// no display or no OpenGL 3.3; whatever goes wrong later is a message in the window.
void run_viewer(const ViewSession& session, const std::string& device, const Progress& progress);

}  // namespace xraycast
