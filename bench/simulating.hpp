#pragma once

#include "xraycast/coaxial/instruments.hpp"

#include <cstddef>
#include <memory>
#include <vector>

namespace xraycast::bench {

/// A catheter, or a wire in it, in a winding vessel, each with a given number of nodes, most of them in
/// contact, that keep moving.
class InstrumentSteps {
 public:
  /// `devices`: one or two.  `motion`: of the vessel; none: it is still.
  InstrumentSteps(std::size_t instruments, std::size_t nodes, double spacing_mm,
                  std::shared_ptr<const Motion> motion = nullptr);

  /// The time of the next step.
  double next_ms();

 private:
  std::shared_ptr<const Motion> motion_;
  Instruments instruments_;
  std::vector<HubPose> poses_;
  long steps_ = 0;
};

/// Breath and heart of a body about that vessel, as fields of 4 mm with as many keys as the phantom's.
std::shared_ptr<const Motion> breath_and_heart();

}  // namespace xraycast::bench
