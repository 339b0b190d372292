#include "xraycast/mechanics/balloon_model.hpp"

#include "xraycast/base/error.hpp"

#include <cmath>

namespace xraycast {
namespace {

constexpr double kSameDiameter_mm = 0.05;  // charts have a decimal or two

void check_size(double value, bool is_valid, const std::string& where, const char* key, const char* rule) {
  if (!std::isfinite(value) || !is_valid) throw InputError("{}: \"{}\" is {}; {}", where, key, value, rule);
}

void check_chart(const BalloonModel& balloon, double folded_mm, const std::string& where) {
  if (balloon.chart.empty())
    throw InputError("{}: \"chart\" is empty; it lists pairs of pressure in bar and diameter in mm", where);
  BalloonModel::Size before{0, folded_mm};
  for (const BalloonModel::Size& size : balloon.chart) {
    if (!std::isfinite(size.bar) || !std::isfinite(size.diameter_mm) || !(size.bar > before.bar) ||
        !(size.diameter_mm >= before.diameter_mm))
      throw InputError(
          "{}: \"chart\" has {:g} bar, {:g} mm after {:g} bar, {:g} mm; pressures must ascend from above 0, "
          "and diameters must not fall from the catheter's",
          where, size.bar, size.diameter_mm, before.bar, before.diameter_mm);
    before = size;
  }
  if (before.bar < balloon.rated_burst_bar)
    throw InputError("{}: \"chart\" ends at {:g} bar; it must reach \"rated_burst_bar\", {:g}", where,
                     before.bar, balloon.rated_burst_bar);
  const double nominal_mm = balloon.diameter_at_mm(balloon.nominal_bar, folded_mm);
  if (std::abs(nominal_mm - balloon.diameter_mm) > kSameDiameter_mm)
    throw InputError("{}: \"diameter_mm\" is {:g}, but by \"chart\" {:g} at \"nominal_bar\", {:g}", where,
                     balloon.diameter_mm, nominal_mm, balloon.nominal_bar);
}

}  // namespace

double BalloonModel::diameter_at_mm(double bar, double folded_mm) const {
  Size before{0, folded_mm};
  for (const Size& size : chart) {
    if (bar < size.bar)
      return std::lerp(before.diameter_mm, size.diameter_mm, (bar - before.bar) / (size.bar - before.bar));
    before = size;
  }
  return before.diameter_mm;
}

void check(const BalloonModel& balloon, double folded_mm, const std::string& origin) {
  const std::string where = origin + ": balloon";
  constexpr const char* kAboveZero = "it must be above zero";
  check_size(balloon.diameter_mm, balloon.diameter_mm > 0, where, "diameter_mm", kAboveZero);
  check_size(balloon.length_mm, balloon.length_mm > 0, where, "length_mm", kAboveZero);
  check_size(balloon.from_tip_mm, balloon.from_tip_mm >= 0, where, "from_tip_mm", "it must be zero or more");
  check_size(balloon.rated_burst_bar, balloon.rated_burst_bar > 0, where, "rated_burst_bar", kAboveZero);
  check_size(balloon.nominal_bar, balloon.nominal_bar > 0 && balloon.nominal_bar <= balloon.rated_burst_bar,
             where, "nominal_bar", "it must be above zero, and at most \"rated_burst_bar\"");
  check_chart(balloon, folded_mm, where);
}

}  // namespace xraycast
