#pragma once

#include "xraycast/fluoroscope/c_arm.hpp"
#include "xraycast/fluoroscope/pixel_loops.hpp"

#include <cstddef>
#include <cstdint>

namespace xraycast {

/// Noise, gain and digitisation of the detector's electronics.
class ElectronicsStage {
 public:
  /// A pixel of the picture has the noise of all the detector's pixels in it. Without the stage there is no
  /// noise, and the raw signal stays as it is; codes are made for the display.
  ElectronicsStage(bool is_on, const FluoroscopyDetector& detector, double pixel_mm, std::uint32_t seed);

  /// The signal that the largest code stands for. The dark level leaves room for the noise.
  void set_full_scale(double full_kev);
  const Digitiser& digitiser() const { return digitiser_; }
  float rms_kev() const { return rms_kev_; }  ///< of a pixel's noise

  /// Rows in any order, on any threads. The signal becomes what its codes stand for.
  void read_row(std::size_t first_pixel, std::uint32_t frame, int width, float* signal_kev,
                std::uint16_t* codes) const;

 private:
  bool is_on_;
  float rms_kev_;
  int bits_;
  std::uint32_t key_;
  Digitiser digitiser_{};
};

}  // namespace xraycast
