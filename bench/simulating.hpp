#pragma once

#include "xraycast/coaxial/instruments.hpp"

#include <cstddef>
#include <vector>

namespace xraycast::bench {

/// A catheter, or a wire in it, in a winding vessel, each with a given number of nodes, most of them in
/// contact, that keep moving.
class InstrumentSteps {
 public:
  /// `devices`: one or two.
  InstrumentSteps(std::size_t instruments, std::size_t nodes, double spacing_mm);

  /// The time of the next step.
  double next_ms();

 private:
  Instruments instruments_;
  std::vector<HubPose> poses_;
  long steps_ = 0;
};

}  // namespace xraycast::bench
