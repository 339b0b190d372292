#pragma once

#include "xraycast/acquisition/mask_phase.hpp"
#include "xraycast/base/progress.hpp"
#include "xraycast/fluoroscope/fluoroscope.hpp"
#include "xraycast/scene/session_file.hpp"
#include "xraycast/serving/intervention.hpp"

#include <filesystem>
#include <optional>
#include <string>

namespace xraycast {

/// The interactive viewer, until its window is closed or `progress` cancelled. `device` chooses the OpenCL
/// device as for ComputeDevice. Files of the session are read once the window is open. Throws Error when
/// there is no display or no OpenGL 3.3; later errors are messages in the window. With
/// `simulation` a catheter is steered in it; throws as Intervention does. With `fluoroscopy` it begins with a
/// fluoroscope's pictures, of which masks are of `mask_phase`. A map that moves does so as `body` says; in a
/// simulation, as its run does. Its report is written into a file as the window closes, unless `report` is
/// empty.
void run_viewer(const ViewSession& session, const std::string& device, const Progress& progress,
                const std::optional<Intervention::Options>& simulation = {},
                const std::optional<FluoroscopyOptions>& fluoroscopy = {}, const BodyRequest& body = {},
                const std::optional<MaskPhase>& mask_phase = {}, const std::filesystem::path& report = {});

}  // namespace xraycast
