#pragma once

#include "xraycast/catheter/aneurysm_sac.hpp"

namespace xraycast {

/// The coils in a sac, as a porous medium of wires.
struct CoilBed {
  double packing = 0;  ///< the coils' volume over the sac's, 0 to below 1
  double wire_mm = 0;  ///< their primary diameter
};

/// Permeability of a bed of wires, in mm2: Kozeny and Carman's, e^3 / (5 S^2) with the void's share e = 1 - p
/// and the surface S = 4 p / d of wires of the diameter d in a volume (Carman, Trans Inst Chem Eng 15:150,
/// 1937), as coiled aneurysms have been modelled (Kakalis et al., IEEE Trans Med Imaging 27:814, 2008; Otani
/// et al., Med Biol Eng Comput 51:901, 2013). Infinite without coils.
double permeability_mm2(const CoilBed& bed);

/// How much blood flows into a sac, and as much out of it, beside a vessel with a flow, in ml/s.
///
/// Without coils the flow past the neck drags blood along: through half of the neck it goes in, at
/// kNeckShare of the vessel's mean velocity, and no more than what flows there, by a pressure that is the
/// vessel's dynamic one, rho u^2 / 2. With coils that pressure drives it through the bed too, over the sac's
/// diameter by Darcy's law: both resistances in series.
double sac_inflow_ml_s(const AneurysmSac& sac, double vessel_ml_s, const CoilBed& bed = {});

/// Chosen: with it a sac of 10 mm with a neck of 5 mm beside a vessel of 4 mm is renewed by a thirteenth of
/// the vessel's flow. Measured and computed inflows scatter about it by a factor of three, by the vessel's
/// bend.
inline constexpr double kNeckShare = 0.1;

}  // namespace xraycast
