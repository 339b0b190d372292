#pragma once

#include "suite.hpp"

namespace xraycast::bench {

/// Prints what key maps of the thorax phantom show, weigh and take, by the numbers of their phases: frames of
/// 16 layers at ten random instants from three angles, against DRRs of the phantom of that instant; with maps
/// that were cast from these phantoms, and one that stands still.
void measure_moving(Bench& bench);

}  // namespace xraycast::bench
