#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace xraycast {

/// A row of what the quanta are drawn from: shares of the open field's quanta behind the patient and between
/// the blades, scattered quanta, and the energies of a quantum.
struct QuantaRow {
  const float *primary, *field, *scattered, *mean_kev, *spread_kev;
};

/// The quanta that the scintillator absorbs.
class QuantaStage {
 public:
  QuantaStage(bool has_noise, std::uint32_t seed);

  /// Their energy in each pixel of a row; rows in any order, on any threads.
  void absorb_row(const QuantaRow& row, double open_quanta, std::size_t first_pixel, std::uint32_t frame,
                  std::vector<float>& energy_kev) const;

 private:
  bool has_noise_;
  std::uint32_t key_, few_key_;
};

}  // namespace xraycast
