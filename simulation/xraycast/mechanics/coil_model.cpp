#include "xraycast/mechanics/coil_model.hpp"

#include "xraycast/base/error.hpp"

#include <numbers>

namespace xraycast {
namespace {

void check_size(double mm, double least_mm, double most_mm, const char* key, const std::string& origin) {
  if (!(mm >= least_mm && mm <= most_mm))
    throw InputError("{}: \"{}\" is {:g}; coils have {:g} to {:g} mm", origin, key, mm, least_mm, most_mm);
}

}  // namespace

double CoilModel::volume_mm3() const { return 0.25 * std::numbers::pi * wire_mm * wire_mm * length_mm; }

void check(const CoilModel& coil, const std::string& origin) {
  constexpr double kThinnest_mm = 0.1, kThickest_mm = 1, kWidest_mm = 40, kLongest_mm = 1000, kTightest = 4;
  check_size(coil.wire_mm, kThinnest_mm, kThickest_mm, "wire_mm", origin);
  check_size(coil.loop_mm, kTightest * coil.wire_mm, kWidest_mm, "loop_mm", origin);
  check_size(coil.length_mm, coil.loop_mm, kLongest_mm, "length_mm", origin);
}

}  // namespace xraycast
