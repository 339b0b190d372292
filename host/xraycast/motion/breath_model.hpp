#pragma once

#include <utility>
#include <vector>

// How a trunk moves in a quiet breath, from the end of expiration to that of inspiration. docs/motion.md
// lists values and sources.
namespace xraycast::breath_model {

inline constexpr double kDiaphragm_mm = 12;  ///< its excursion, unless another is asked for
inline constexpr double kPeriod_s = 4;

/// Seconds and phase over a breath: in, out, and at rest for its last quarter.
std::vector<std::pair<double, double>> waveform();

/// A height above the right dome of the diaphragm as that of a man whose lungs rise 186 mm above it; those
/// below it stay.
double model_height_mm(double height_mm, double lung_mm);

// The following take such heights.

/// Caudal shares of the diaphragm's excursion: of lungs and abdominal organs, and of heart and mediastinum.
double organ_share(double height_mm);
double mediastinal_share(double height_mm);

/// How far the ventral wall moves forwards when the diaphragm moves by kDiaphragm_mm.
double wall_mm(double height_mm);

/// The share of the wall's movement at a place between a hinge in front of the spine, 0, and the skin, 1.
double forwards_share(double from_hinge);

}  // namespace xraycast::breath_model
