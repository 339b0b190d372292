#include "xraycast/fluoroscope/electronics_stage.hpp"

#include <algorithm>
#include <vector>

namespace xraycast {

ElectronicsStage::ElectronicsStage(bool is_on, const FluoroscopyDetector& detector, double pixel_mm,
                                   std::uint32_t seed)
    : is_on_(is_on),
      rms_kev_(is_on ? static_cast<float>(detector.electronic_noise_kev * pixel_mm / detector.pixel_mm) : 0),
      bits_(detector.bits),
      key_(noise_key(seed, NoiseUse::electronics)) {}

void ElectronicsStage::set_full_scale(double full_kev) {
  constexpr double kDarkShare = 1.0 / 256, kDarkSpreads = 5;
  const double most = (1 << bits_) - 1, dark_kev = kDarkSpreads * rms_kev_;
  const double dark = std::max(kDarkShare * most, most * dark_kev / (full_kev + dark_kev));
  digitiser_ = {static_cast<float>((most - dark) / full_kev), static_cast<float>(dark),
                static_cast<float>(most)};
}

void ElectronicsStage::read_row(std::size_t first_pixel, std::uint32_t frame, int width, float* signal_kev,
                                std::uint16_t* codes) const {
  if (rms_kev_ > 0) {
    thread_local std::vector<float> normals;
    normals.resize(static_cast<std::size_t>(width) + 1);
    electronic_noise_row(rms_kev_, static_cast<std::uint32_t>(first_pixel), {key_, frame}, width, signal_kev,
                         normals.data());
  }
  digitise_row(digitiser_, width, signal_kev, codes);
  if (is_on_) signal_of_codes_row(digitiser_, width, codes, signal_kev);
}

}  // namespace xraycast
