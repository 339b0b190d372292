#pragma once

#include "xraycast/phantom/phantom_scene.hpp"

namespace xraycast {

/// What lies below the head's phantom, in its coordinates: shoulders, upper chest and arms beside it, down to
/// z = -330.
void shoulder_outline(PhantomScene& scene, double deeper_mm);

/// Their bones, lungs and windpipe, within the soft tissue.
void paint_shoulders(PhantomScene& scene);

}  // namespace xraycast
