#include "xraycast/simulation/coiling.hpp"

#include "xraycast/blood_flow/rest_flow.hpp"

#include <fmt/format.h>

namespace xraycast {
namespace {

double inflow_share(const AneurysmSac& sac, double vessel_ml_s, const CoilBed& bed) {
  const double open_ml_s = sac_inflow_ml_s(sac, vessel_ml_s);
  return open_ml_s > 0 ? sac_inflow_ml_s(sac, vessel_ml_s, bed) / open_ml_s : 1;
}

/// Those of a sac, beside a vessel with a flow.
void add_coilings(const CoilPack& pack, double vessel_ml_s, const VesselTree& tree,
                  std::vector<Coiling>& all) {
  CoilSum so_far;
  for (const LaidCoil& coil : pack.coils()) {
    so_far.add(coil);
    const double sac_mm3 = pack.sac().volume_mm3();
    const CoilBed bed{so_far.laid_mm3 / sac_mm3, so_far.wire_mm()};
    all.push_back({.instrument = coil.instrument,
                   .device = coil.device,
                   .branch = pack.sac().branch,
                   .vessel = tree.title(pack.sac().branch),
                   .coil = coil.model,
                   .laid_mm = coil.laid_mm,
                   .is_detached = coil.is_detached,
                   .from_s = coil.from_s,
                   .to_s = coil.to_s,
                   .sac_mm3 = sac_mm3,
                   .packing = bed.packing,
                   .inflow_share = inflow_share(pack.sac(), vessel_ml_s, bed)});
  }
}

}  // namespace

std::vector<double> flows_past_sacs(const VesselTree& tree) {
  std::vector<double> past_ml_s;
  const std::vector<AneurysmSac> sacs = sacs_of(tree);
  if (sacs.empty()) return past_ml_s;
  const RestFlow rest = rest_flow(tree, Blood{});
  for (const AneurysmSac& sac : sacs) {
    const int vessel = tree.branches()[static_cast<std::size_t>(sac.branch)].parent;
    past_ml_s.push_back(rest.ml_s[static_cast<std::size_t>(vessel)]);
  }
  return past_ml_s;
}

std::vector<Coiling> coilings_of(const Instruments& instruments, const std::vector<double>& past_ml_s) {
  std::vector<Coiling> all;
  for (std::size_t s = 0; s < past_ml_s.size(); ++s)
    add_coilings(instruments.coil_packs()[s], past_ml_s[s], instruments.tree(), all);
  return all;
}

std::string in_words(const Coiling& coiling) {
  constexpr double kPercent = 100;
  return fmt::format(
      "{} in {}: {:g} mm by {:g} mm, {}; sac of {:.0f} mm3 packed to {:.1f} %, inflow {:.0f} % of that "
      "without coils",
      coiling.device, coiling.vessel, coiling.coil.loop_mm, coiling.coil.length_mm,
      coiling.is_detached ? std::string("detached")
                          : fmt::format("{:.0f} mm of it out, not detached", coiling.laid_mm),
      coiling.sac_mm3, kPercent * coiling.packing, kPercent * coiling.inflow_share);
}

CoilBed bed_of(const CoilPack& pack) { return {pack.packing(), pack.sum().wire_mm()}; }

void take_coils(const Instruments& instruments, ContrastBolus& bolus) {
  for (std::size_t s = 0; s < instruments.coil_packs().size(); ++s)
    bolus.pack(s, bed_of(instruments.coil_packs()[s]));
}

}  // namespace xraycast
