#include "xraycast/fluoroscope/quanta_stage.hpp"

#include "xraycast/fluoroscope/pixel_loops.hpp"

namespace xraycast {

QuantaStage::QuantaStage(bool has_noise, std::uint32_t seed)
    : has_noise_(has_noise),
      key_(noise_key(seed, NoiseUse::quanta)),
      few_key_(noise_key(seed, NoiseUse::few_quanta)) {}

void QuantaStage::absorb_row(const QuantaRow& row, double open_quanta, std::size_t first_pixel,
                             std::uint32_t frame, std::vector<float>& energy_kev) const {
  const int width = static_cast<int>(energy_kev.size());
  thread_local std::vector<float> counts, normals;
  counts.resize(energy_kev.size());
  quanta_counts_row(row.primary, row.field, row.scattered, static_cast<float>(open_quanta), width,
                    counts.data());
  if (!has_noise_) return expected_energy_row(counts.data(), row.mean_kev, width, energy_kev.data());
  normals.resize(2 * energy_kev.size());
  quantum_noise_row(counts.data(), row.mean_kev, row.spread_kev, static_cast<std::uint32_t>(first_pixel),
                    {key_, frame}, {few_key_, frame}, width, energy_kev.data(), normals.data());
}

}  // namespace xraycast
