#include "xraycast/blood_flow/sac_inflow.hpp"

#include "xraycast/blood_flow/blood.hpp"
#include "xraycast/blood_flow/vessel_impedance.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace xraycast {

double permeability_mm2(const CoilBed& bed) {
  if (bed.packing <= 0) return std::numeric_limits<double>::infinity();
  constexpr double kCarman = 5;
  const double open = 1 - bed.packing, surface_per_mm = 4 * bed.packing / bed.wire_mm;
  return open * open * open / (kCarman * surface_per_mm * surface_per_mm);
}

double sac_inflow_ml_s(const AneurysmSac& sac, double vessel_ml_s, const CoilBed& bed) {
  constexpr double kMm3_per_ml = 1e3, kPa_per = 1e-6;  // of kg/m3 mm2/s2
  const double vessel_mm2 = std::numbers::pi * sac.vessel_radius_mm * sac.vessel_radius_mm,
               half_neck_mm2 = 0.5 * std::numbers::pi * sac.neck_radius_mm * sac.neck_radius_mm;
  const double mm_s = kMm3_per_ml * std::abs(vessel_ml_s) / vessel_mm2;
  if (mm_s == 0) return 0;
  const double free_mm3_s = std::min(kNeckShare * mm_s * half_neck_mm2, mm_s * vessel_mm2);
  const double driving_pa = 0.5 * kBloodDensity_kg_m3 * kPa_per * mm_s * mm_s;
  const double bed_pa =
      kBloodViscosity_Pa_s * 2 * sac.radius_mm * free_mm3_s / (permeability_mm2(bed) * half_neck_mm2);
  return free_mm3_s / (1 + bed_pa / driving_pa) / kMm3_per_ml;
}

}  // namespace xraycast
