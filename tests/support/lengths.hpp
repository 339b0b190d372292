#pragma once

#include "xraycast/attenuation/opacity.hpp"

namespace xraycast::test {

/// Air is 0 and water 1 per mm, so that optical depths are lengths in mm.
inline const Opacity& lengths() {
  static const Opacity opacity("lengths", {{-1024, 0}, {0, 1}});
  return opacity;
}

}  // namespace xraycast::test
