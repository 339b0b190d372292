#pragma once

#include "xraycast/blood_flow/heart_waveform.hpp"

#include <memory>

namespace xraycast {

inline constexpr double kBloodDensity_kg_m3 = 1060, kBloodViscosity_Pa_s = 3.5e-3;

/// The blood of a body at rest, and how it flows through a vessel tree.
struct Blood {
  /// Of the tree's root, a mean over a heartbeat, unless the root's name tells its flow. 5 l/min through an
  /// aorta of 25 mm are 170 mm/s, and the mean velocities in the arteries that leave it are similar (Caro et
  /// al., The Mechanics of the Circulation, 2012). Of another output of the heart it is in proportion to it.
  double root_velocity_mm_s = 170;
  double heart_rate_bpm = 70;  ///< 0: steady flow; without effect where there is a waveform
  /// A bifurcation into vessels without names divides the flow by this power of their radii. 2 keeps the
  /// velocity, as in large arteries; arterioles follow Murray's cube (Zamir, The Physics of Pulsatile Flow,
  /// 2000).
  double split_exponent = 2;
  /// Of the periphery's resistance of coronary arteries: 1 at rest. At hyperaemia, by adenosine, it is
  /// kHyperaemia (Wilson et al., Circulation 82:1595, 1990).
  double coronary_resistance = 1;
  /// Of that of all other arteries: papaverine or exercise lower it.
  double other_resistance = 1;
  double profile_exponent = 0;  ///< of every LaminarVessel; 0: by its Womersley number
  /// Of a molecule of 800 g/mol in plasma, by Stokes and Einstein.
  double diffusivity_mm2_s = 3e-4;
  /// Of this body's heart; its mean is the heart's output. Null: a heart at rest, see Heartbeat.
  std::shared_ptr<const HeartWaveform> heart{};
};

/// A heart's output at rest.
inline constexpr double kHeartOutput_ml_s = 5000.0 / 60;

/// What the heart gives in its mean.
double heart_output_ml_s(const Blood& blood);

/// Throws InputError for a heart rate, a velocity, resistances or a waveform out of range.
void check(const Blood& blood);

inline constexpr double kHyperaemia = 0.24;

}  // namespace xraycast
