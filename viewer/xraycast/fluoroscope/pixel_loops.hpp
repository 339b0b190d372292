#pragma once

#include "xraycast/fluoroscope/blur.hpp"
#include "xraycast/fluoroscope/counter_noise.hpp"

#include <cstdint>
#include <vector>

// The chain's loops over the pixels of a row, for a compiler to vectorise.
namespace xraycast {

/// Detected quanta by the optical depth, at even steps from 0, linear between them. Below the first step and
/// beyond the last, as there; NaN counts as 0.
struct QuantaTable {
  /// Side by side in memory, since each pixel reads all of two steps.
  struct alignas(16) Step {
    float share;  ///< of the open field's quanta
    float mean_kev, spread_kev;
    float unused = 0;
  };
  float steps_per_tau = 0;
  std::vector<Step> steps;
};

void look_up_row(const QuantaTable& table, const float* tau, int count, float* share, float* mean_kev,
                 float* spread_kev);

/// `padded` has as many pixels before and behind the row as the filter has neighbours. Where weights are
/// negative, the result is at least 0.9 of the least of a pixel and both neighbours.
void filter_row(const float* padded, const SymmetricTaps& taps, int count, float* out);

/// The same across rows: rows[0] is the highest, rows[taps.size() - 1] the filtered row's own. `weight` times
/// the result is in `out`, or is added to it.
void filter_column(const float* const* rows, const SymmetricTaps& taps, float weight, int count, float* out);
void add_filtered_column(const float* const* rows, const SymmetricTaps& taps, float weight, int count,
                         float* out);

/// Adds the sums of each PictureSize::kBand pixels, and of what is left at the end, to their cells.
void add_to_cells_row(const float* share, const float* field, int count, float* cell_share,
                      float* cell_primary);

/// The most quanta of a pixel: beyond, floats do not resolve their noise.
inline constexpr float kMostQuanta = 1e12f;

/// out = primary (share x field) + scatter, at most kMostQuanta; beside sharp edges a little below 0, as the
/// light's filter needs it.
void quanta_counts_row(const float* share, const float* field, const float* scatter, float open_quanta,
                       int count, float* out);

/// Random numbers of a frame's pixels.
struct NoiseStream {
  std::uint32_t key, frame;
};

/// Two independent standard normal numbers a pixel.
void normals_row(std::uint32_t first, NoiseStream noise, int count, float* one, float* other);

/// Poisson numbers of means below kLeastExpandedMean, by adding up the distribution; others are left out.
void few_quanta_row(const float* means, std::uint32_t first, NoiseStream noise, int count, float* quanta);

/// Energy in keV that Poisson numbers of quanta leave; `counts` are the expected numbers.
/// What is below 0 stays so, without noise. `normals` is room for two numbers a pixel. `few` is the stream
/// for small numbers.
void quantum_noise_row(const float* counts, const float* mean_kev, const float* spread_kev,
                       std::uint32_t first_pixel, NoiseStream noise, NoiseStream few, int count,
                       float* energy_kev, float* normals);
void expected_energy_row(const float* counts, const float* mean_kev, int count, float* energy_kev);

/// One trap of the detector's charge: takes a share of the signal in, and gives back what decayed since the
/// last frame.
void lag_row(float fraction, float decayed, int count, const float* signal, float* kept, float* out);

void electronic_noise_row(float rms_kev, std::uint32_t first_pixel, NoiseStream noise, int count,
                          float* signal, float* normals);

struct Digitiser {
  float codes_per_kev, dark, most;
};
void digitise_row(const Digitiser& digitiser, int count, const float* signal, std::uint16_t* codes);

/// The signal that codes stand for.
void signal_of_codes_row(const Digitiser& digitiser, int count, const std::uint16_t* codes, float* signal);

}  // namespace xraycast
