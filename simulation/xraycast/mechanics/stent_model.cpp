#include "xraycast/mechanics/stent_model.hpp"

#include "xraycast/base/error.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace xraycast {
namespace {

void check_outward(const StentModel& stent, const std::string& where) {
  StentModel::Force before{0, 0};
  for (const StentModel::Force& force : stent.outward) {
    const bool is_first = &force == &stent.outward.front();
    if (!std::isfinite(force.diameter_mm) || !std::isfinite(force.outward_N_mm) ||
        !(force.diameter_mm > before.diameter_mm) || !(force.outward_N_mm >= 0) ||
        !(is_first || force.outward_N_mm <= before.outward_N_mm))
      throw InputError(
          "{}: \"outward_N_mm\" has {:g} mm, {:g} N/mm after {:g} mm, {:g} N/mm; diameters must ascend from "
          "above 0, and forces must not grow",
          where, force.diameter_mm, force.outward_N_mm, before.diameter_mm, before.outward_N_mm);
    before = force;
  }
  if (before.diameter_mm != stent.diameter_mm || before.outward_N_mm != 0)
    throw InputError(
        "{}: \"outward_N_mm\" ends with {:g} mm, {:g} N/mm; it must end with \"diameter_mm\", {:g}, and 0",
        where, before.diameter_mm, before.outward_N_mm, stent.diameter_mm);
}

}  // namespace

double StentModel::outward_N_mm(double at_mm) const {
  Force before{0, outward.empty() ? 0 : outward.front().outward_N_mm};
  for (const Force& force : outward) {
    if (at_mm < force.diameter_mm)
      return std::lerp(before.outward_N_mm, force.outward_N_mm,
                       (at_mm - before.diameter_mm) / (force.diameter_mm - before.diameter_mm));
    before = force;
  }
  return 0;
}

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

double StentModel::length_of_mm(std::span<const double> radii_mm) const {
  double sum_mm = radii_mm.empty() ? 0 : static_cast<double>(radii_mm.size() - 1) * link_mm;
  for (const double radius_mm : radii_mm) sum_mm += ring_height_mm(2 * radius_mm);
  return sum_mm;
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
  if (stent.expands_itself()) check_outward(stent, where);
}

}  // namespace xraycast
