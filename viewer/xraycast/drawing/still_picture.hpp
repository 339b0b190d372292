#pragma once

#include "xraycast/drawing/renderer.hpp"
#include "xraycast/export/export_request.hpp"

#include <string>

namespace xraycast {

/// What a page shows where it cannot draw: a PNG of its first picture. The renderer's map and surfaces are
/// replaced.
std::string still_png(Renderer& renderer, const ExportRequest& request);

/// The same in an OpenGL context of its own.
std::string still_png(const ExportRequest& request);

}  // namespace xraycast
