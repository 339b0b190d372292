#pragma once

#include <string>

namespace xraycast {

struct SolidMaterial;

/// The increase of mu per concentration of a dissolved element in a fluoroscopy beam: 80 kVp, hardened by 20
/// cm of water, which is about a trunk at mid-depth. Relative to water in the same beam and on the scale of
/// body maps, where water has 0.02/mm, so that vessels have the same contrast as in a map. `element` is a
/// symbol, coefficients are xraylib's.
double fluoroscopy_per_mm(const std::string& element, double mg_ml);

/// The same of a solid: what its elements add up to.
double fluoroscopy_per_mm(const SolidMaterial& solid);

/// Iodine in arteries while contrast agent is injected: an agent of 350 mg/ml (iohexol 350, iopromide 370),
/// diluted by the blood to a seventh.
inline constexpr double kUsualContrast_mg_ml = 50, kMaxContrast_mg_ml = 400;

}  // namespace xraycast
