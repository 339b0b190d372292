#pragma once

#include "suite.hpp"

#include <filesystem>

namespace xraycast::bench {

/// How the time of a cast grows with slices, angles, layers and knots: numbers on stdout, and a plot.
void measure_scaling(Bench& bench, const std::filesystem::path& plot);

/// How the time of a frame grows with layers and pixels, likewise.
void measure_drawing_scaling(Bench& bench, const std::filesystem::path& plot);

/// How the time of a step grows with a catheter's nodes, likewise.
void measure_rod_scaling(const std::filesystem::path& plot);

/// How the time of vesselness grows with the voxels: numbers on stdout, and a plot.
void measure_segmenting_scaling(Bench& bench, const std::filesystem::path& plot);

}  // namespace xraycast::bench
