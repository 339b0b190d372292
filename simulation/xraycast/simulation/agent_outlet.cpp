#include "xraycast/simulation/agent_outlet.hpp"

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

std::string reason_for_no_outlet(const std::vector<InstrumentModel>& models) {
  // Only the innermost can be solid; with a lumen it would have been the outlet.
  const std::string& solid = models.back().name();
  if (models.size() == 1) return fmt::format("{} has no lumen", solid);
  return fmt::format("{} has no lumen and lies in the others; draw it back to 0 to inject", solid);
}

}  // namespace xraycast
