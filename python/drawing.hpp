#pragma once

#include "xraycast/casting/body_map.hpp"
#include "xraycast/casting/view.hpp"
#include "xraycast/export/export_request.hpp"

#include <memory>
#include <string>
#include <vector>

namespace xraycast::python {

/// The optical depths of a body map's frame. Drawn by a thread that keeps an OpenGL context, since a context
/// belongs to one thread and takes longer to make than a frame. Throws as HeadlessContext does, and Error in
/// a process that was forked from one that has drawn. Without the interpreter's lock.
std::vector<float> drawn_tau(const std::shared_ptr<const BodyMap>& map, const View& view);

/// The same for a page's still picture.
std::string drawn_still(const ExportRequest& request);

/// Ends the thread, before the libraries that it uses are unloaded.
void stop_drawing();

}  // namespace xraycast::python
