#pragma once

#include "xraycast/drawing/renderer.hpp"

#include <functional>

namespace xraycast::python {

/// Draws by a thread that keeps an OpenGL context, since a context belongs to one thread and takes longer to
/// make than a frame. Throws as HeadlessContext and `work` do, and Error in a process that was forked from
/// one that has drawn. Without the interpreter's lock.
void draw(const std::function<void(Renderer& renderer)>& work);

/// Ends the thread, before the libraries that it uses are unloaded.
void stop_drawing();

}  // namespace xraycast::python
