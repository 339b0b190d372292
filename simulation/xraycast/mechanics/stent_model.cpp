#include "xraycast/mechanics/stent_model.hpp"

#include "xraycast/base/error.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace xraycast {

double StentModel::across_mm(double opened_mm) const {
  return std::numbers::pi * opened_mm / (2 * static_cast<double>(crowns));
}

double StentModel::strut_length_mm() const {
  const double height_mm = (length_mm - (rings - 1) * link_mm) / rings;
  return std::hypot(height_mm, across_mm(diameter_mm));
}

double StentModel::ring_height_mm(double opened_mm) const {
  const double length = strut_length_mm(), across = across_mm(opened_mm);
  return std::sqrt(std::max(0.0, length * length - across * across));
}

double StentModel::length_at_mm(double opened_mm) const {
  return rings * ring_height_mm(opened_mm) + (rings - 1) * link_mm;
}

double StentModel::widest_mm() const { return 2 * crowns * strut_length_mm() / std::numbers::pi; }

void check(const StentModel& stent, double largest_mm, const std::string& origin) {
  constexpr int kFewestCrowns = 3, kMost = 1000;
  const std::string where = origin + ": stent";
  const std::pair<const char*, double> sizes[] = {{"diameter_mm", stent.diameter_mm},
                                                  {"length_mm", stent.length_mm},
                                                  {"link_mm", stent.link_mm},
                                                  {"strut_mm", stent.strut_mm}};
  for (const auto& [key, value] : sizes)
    if (!std::isfinite(value) || !(value > 0))
      throw InputError("{}: \"{}\" is {}; it must be above zero", where, key, value);
  if (stent.rings < 1 || stent.rings > kMost)
    throw InputError("{}: \"rings\" is {}; it must be 1 to {}", where, stent.rings, kMost);
  if (stent.crowns < kFewestCrowns || stent.crowns > kMost)
    throw InputError("{}: \"crowns\" is {}; it must be {} to {}", where, stent.crowns, kFewestCrowns, kMost);
  if (stent.links < 1 || stent.links > stent.crowns)
    throw InputError("{}: \"links\" is {}; it must be 1 to \"crowns\", {}", where, stent.links, stent.crowns);
  if (!(stent.length_mm > (stent.rings - 1) * stent.link_mm))
    throw InputError("{}: \"length_mm\" is {:g}; {} links of {:g} mm leave nothing for the rings", where,
                     stent.length_mm, stent.rings - 1, stent.link_mm);
  if (stent.widest_mm() < largest_mm)
    throw InputError(
        "{}: its struts reach around {:.2f} mm, but the balloon opens it to {:.2f}; take more crowns or "
        "fewer "
        "rings",
        where, stent.widest_mm(), largest_mm);
}

}  // namespace xraycast
