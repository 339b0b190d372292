#pragma once

#include "xraycast/trainer/fluoroscope_setup.hpp"

namespace xraycast {

/// From which all FluoroscopyBeams of a page are copied.
void set_page_beams(TubeBeams beams);

}  // namespace xraycast
