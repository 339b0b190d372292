#pragma once

#include "xraycast/blood_flow/sac_inflow.hpp"
#include "xraycast/coaxial/instruments.hpp"
#include "xraycast/contrast_agent/contrast_bolus.hpp"

#include <string>
#include <vector>

namespace xraycast {

/// A coil in a sac, and what the sac is like with it and those before.
struct Coiling {
  std::size_t instrument = 0;
  std::string device;
  int branch = 0;      ///< of the sac
  std::string vessel;  ///< the branch in words
  CoilModel coil{};
  double laid_mm = 0;
  bool is_detached = false;
  double from_s = 0, to_s = 0;  ///< of Instruments::time_s(): as it came out, and was detached
  double sac_mm3 = 0;
  double packing = 0;       ///< volume of the coils over the sac's
  double inflow_share = 1;  ///< of the sac's inflow without coils, at the vessel's flow at rest
};

/// At rest, of the vessel that each of a tree's sacs leaves (see sacs_of), in ml/s.
std::vector<double> flows_past_sacs(const VesselTree& tree);

/// All that lie in sacs, sac by sac in the order in which they were pushed, beside vessels with these flows.
std::vector<Coiling> coilings_of(const Instruments& instruments, const std::vector<double>& past_ml_s);

/// `coil-10x30 in aneurysm: 10 mm by 300 mm, detached; sac of 517 mm3 packed to 23.5 %, inflow 44 % of
/// that without coils`.
std::string in_words(const Coiling& coiling);

/// The coils as a bed for the blood; none: nothing resists.
CoilBed bed_of(const CoilPack& pack);

/// Packs the sacs of a flow as those of instruments in the same tree are.
void take_coils(const Instruments& instruments, ContrastBolus& bolus);

}  // namespace xraycast
