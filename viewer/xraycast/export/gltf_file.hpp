#pragma once

#include "xraycast/export/export_request.hpp"

#include <string>

namespace xraycast {

/// The solid things of a session as binary glTF 2.0 (ISO/IEC 12113), in metres with the head upwards (+Y) and
/// the patient's front towards +Z: vessels, catheters (of a run: where its instruments end), the body's axis,
/// and the C-arm at the session's pose; a parallel beam's stands as a C-arm of 780 and 1200 mm. The map stays
/// out: glTF has no additive blending.
std::string gltf_binary(const ExportRequest& request);

}  // namespace xraycast
