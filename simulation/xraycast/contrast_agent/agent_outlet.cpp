#include "xraycast/contrast_agent/agent_outlet.hpp"

#include <fmt/format.h>

namespace xraycast {

std::optional<std::size_t> agent_outlet(const Instruments& instruments) {
  const std::optional<std::size_t> free = instruments.free_lumen();
  if (!free || instruments.rods().bare_mm(*free) > 0) return free;
  // Of the tubes around its tip the agent leaves the one that reaches furthest.
  std::size_t furthest = 0;
  for (std::size_t outer = 1; outer < *free; ++outer)
    if (instruments.rod(outer).fed_mm() > instruments.rod(furthest).fed_mm()) furthest = outer;
  return furthest;
}

double agent_lumen_mm(const Instruments& instruments) {
  const std::optional<std::size_t> free = instruments.free_lumen();
  return free ? 2 * instruments.rod(*free).instrument().inner_radius_mm() : 0;
}

void InjectedVolume::advance(const Instruments& instruments, double time_s, const Injection& injection) {
  if (time_s <= time_s_) return;
  const double ml = injection.mean_rate_ml_s(time_s_, time_s) * (time_s - time_s_);
  time_s_ = time_s;
  if (ml <= 0) return;
  if (!agent_outlet(instruments)) {
    withheld_ml_ += ml;
    return;
  }
  injected_ml_ += ml;
  const Particles& particles = injection.particles;
  if (particles.are_any() && !particles.through(agent_lumen_mm(instruments)).are_any()) strained_ml_ += ml;
}

std::string reason_for_no_outlet(const std::vector<InstrumentModel>& models) {
  // Only the innermost can be solid; with a lumen it would have been the outlet.
  const std::string& solid = models.back().name();
  if (models.size() == 1) return fmt::format("{} has no lumen", solid);
  return fmt::format("{} has no lumen and lies in the others; draw it back to 0 to inject", solid);
}

}  // namespace xraycast
