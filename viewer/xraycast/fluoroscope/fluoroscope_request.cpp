#include "xraycast/fluoroscope/fluoroscope_request.hpp"

#include "xraycast/base/error.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <numbers>

namespace xraycast {
namespace {

constexpr const char* kUsualCArm = "fixed-single-plane";

CArm c_arm_of(const FluoroscopeRequest& request) {
  return CArm::named(request.c_arm.empty() ? kUsualCArm : request.c_arm);
}

Collimation collimation_of(const std::vector<double>& numbers) {
  if (numbers.size() < 2 || numbers.size() > 3)
    throw InputError("`collimate` {}: must be WIDTH,HEIGHT in mm on the detector, or WIDTH,HEIGHT,DEG",
                     fmt::join(numbers, ","));
  const double turn_deg = numbers.size() > 2 ? numbers[2] : 0;
  return {numbers[0], numbers[1], turn_deg * std::numbers::pi / 180};
}

DoseLevel level_of(const std::string& dose) {
  if (dose.empty()) return DoseLevel::normal;
  for (const DoseLevel level : {DoseLevel::low, DoseLevel::normal, DoseLevel::cine})
    if (dose == to_string(level)) return level;
  throw InputError("`dose` {}: must be low, normal or cine", dose);
}

}  // namespace

FluoroscopyOptions options_of(const FluoroscopeRequest& request) {
  FluoroscopyOptions options;
  options.c_arm = c_arm_of(request);
  if (request.field_mm && request.c_arm.empty())
    throw InputError("`field_mm` {:g}: is a field of a C-arm; add `c_arm`", *request.field_mm);
  if (!request.c_arm.empty()) options.field_mm = zoom_field_mm(options.c_arm, request.field_mm);
  if (!request.collimate.empty()) options.collimation = collimation_of(request.collimate);
  options.dose = level_of(request.dose);
  options.kvp = request.kvp;
  options.mas = request.mas;
  options.photons = request.photons;
  if (request.pulse_rate) options.pulses_per_s = *request.pulse_rate;
  options.compression = request.compression;
  if (!request.stages.empty()) options.stages = FluoroscopyStages::from_list(request.stages);
  if (request.seed) options.seed = *request.seed;
  check(options);
  return options;
}

View on_c_arm(const FluoroscopeRequest& request, const View& view) {
  if (request.c_arm.empty()) return view;
  const CArm c_arm = c_arm_of(request);
  return view_of(c_arm, zoom_field_mm(c_arm, request.field_mm), view);
}

}  // namespace xraycast
