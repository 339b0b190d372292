#pragma once

#include "xraycast/catheter/catheter.hpp"
#include "xraycast/coaxial/coaxial_catheters.hpp"

#include <array>
#include <cstddef>
#include <memory>

namespace xraycast::bench {

/// A catheter with a given number of nodes, most of them in contact, that keeps moving.
class CatheterSteps {
 public:
  CatheterSteps(std::size_t nodes, double spacing_mm);

  /// The time of the next step.
  double next_ms();

 private:
  std::unique_ptr<Catheter> catheter_;
  HubPose pose_;
  long steps_ = 0;
};

/// A wire in a catheter in the same vessel, each with a given number of nodes, that keep moving.
class CoaxialSteps {
 public:
  CoaxialSteps(std::size_t nodes, double spacing_mm);

  /// The time of the next step.
  double next_ms();

 private:
  std::unique_ptr<CoaxialCatheters> devices_;
  std::array<HubPose, 2> poses_;
  long steps_ = 0;
};

}  // namespace xraycast::bench
