#include "xraycast/fluoroscope/xray_generator.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace xraycast {
namespace {

constexpr double kSecondsPerMinute = 60;

}  // namespace

XrayGenerator::XrayGenerator(FluoroscopyOptions options, WaterPath path)
    : options_(std::move(options)),
      path_(std::move(path)),
      absorbed_kev_(absorbed_kev_per_uGy(options_.c_arm.detector)) {
  check(options_);
}

void XrayGenerator::set_detector(const Cone& distances, double pixel_mm) {
  constexpr double kCm2_per_mm2 = 0.01;
  const bool is_first = pixel_cm2_ == 0;
  pixel_cm2_ = kCm2_per_mm2 * pixel_mm * pixel_mm;
  last_mean_kev_ = 0;
  if (distances != options_.c_arm.distances) {
    options_.c_arm.distances = distances;
    beams_.clear();
    tables_.clear();
  }
  full_scale_kev_ = 0;
  if (is_first || options_.photons) technique_ = first_technique();
}

void XrayGenerator::set_path(WaterPath path) {
  path_ = std::move(path);
  tables_.clear();
}

const FluoroscopyBeam& XrayGenerator::beam(int kvp) {
  if (const auto known = beams_.find(kvp); known != beams_.end()) return known->second;
  const CArm& c_arm = options_.c_arm;
  return beams_
      .emplace(kvp,
               options_.spectrum ? FluoroscopyBeam(c_arm, *options_.spectrum) : FluoroscopyBeam(c_arm, kvp))
      .first->second;
}

BeamAndTable XrayGenerator::beam_and_table() {
  const int kvp = technique_.kvp;
  const FluoroscopyBeam& now = beam(kvp);
  auto known = tables_.find(kvp);
  if (known == tables_.end()) known = tables_.emplace(kvp, now.table(path_)).first;
  return {&now, &known->second};
}

// ---- the technique ------------------------------------------------------------------------------------

double XrayGenerator::target_kev() const {
  const CArm& c_arm = options_.c_arm;
  const double kerma_uGy = options_.dose == DoseLevel::low      ? c_arm.dose.low_uGy
                           : options_.dose == DoseLevel::normal ? c_arm.dose.normal_uGy
                                                                : c_arm.dose.cine_uGy;
  // A smaller field is shown larger, and its mottle with it.
  const double zoom = options_.field_mm > 0 ? c_arm.fields_mm.front() / options_.field_mm : 1;
  return kerma_uGy * zoom * absorbed_kev_ * pixel_cm2_;
}

ExposureControl XrayGenerator::control() {
  constexpr double kLimit_uGy_min = 88e3;  // 21 CFR 1020.32 (d), but for recording
  const auto signal = [this](int kvp, double g_cm2) {
    return pixel_cm2_ * beam(kvp).spectrum.behind_water(g_cm2).m1;
  };
  const auto permitted = [this](int kvp) {
    if (options_.dose == DoseLevel::cine) return 1e9;
    return kLimit_uGy_min / kSecondsPerMinute / options_.pulses_per_s / beam(kvp).limited_uGy_per_mas;
  };
  return {options_.c_arm.tube, target_kev(), options_.kvp, options_.mas, signal, permitted};
}

Technique XrayGenerator::first_technique() {
  constexpr int kUsual_kvp = 80;
  if (options_.is_automatic()) return control().start();
  const int kvp = options_.kvp.value_or(kUsual_kvp);
  if (options_.mas) return {kvp, *options_.mas};
  if (options_.spectrum) return {kvp, 0};
  const double mas = *options_.photons / quanta_per_mas(kvp);
  return {kvp, mas <= highest_mas(options_.c_arm.tube, kvp) ? mas : 0};  // no tube gives these
}

bool XrayGenerator::follow(double mean_kev, bool is_held) {
  last_ = technique_;
  last_mean_kev_ = mean_kev;
  if (is_held || !options_.is_automatic()) return false;
  technique_ = control().next(technique_, mean_kev);
  return technique_ != last_;
}

void XrayGenerator::set_dose(DoseLevel level) {
  options_.dose = level;
  full_scale_kev_ = 0;
  if (!options_.is_automatic()) return;
  technique_ = last_mean_kev_ > 0 ? control().next(last_, last_mean_kev_) : first_technique();
}

// ---- what it makes ------------------------------------------------------------------------------------

double XrayGenerator::quanta_per_mas(int kvp) { return beam(kvp).open.m0 * pixel_cm2_; }

double XrayGenerator::open_quanta() {
  return options_.photons ? *options_.photons : technique_.mas * quanta_per_mas(technique_.kvp);
}

double XrayGenerator::full_scale_kev() {
  if (full_scale_kev_ == 0) full_scale_kev_ = full_scale_for_options();
  return full_scale_kev_;
}

/// What is set by hand may give more than the control would.
double XrayGenerator::full_scale_for_options() {
  constexpr double kHeadroom = 10, kSpreads = 8, kOpenHeadroom = 1.25, kThin_g_cm2 = 10, kThinHeadroom = 2;
  if (!options_.is_automatic()) {
    const double quanta = open_quanta();
    return beam(technique_.kvp).open.mean_kev() * (kOpenHeadroom * quanta + kSpreads * std::sqrt(quanta) + 1);
  }
  const double usual_kev = kHeadroom * target_kev();
  if (!options_.kvp && !options_.mas) return usual_kev;
  const XrayTube& tube = options_.c_arm.tube;
  const int kvp = options_.kvp.value_or(static_cast<int>(tube.lowest_kvp));
  const double mas = options_.mas.value_or(lowest_mas(tube));
  const double behind_thin_kev = mas * pixel_cm2_ * beam(kvp).spectrum.behind_water(kThin_g_cm2).m1;
  return std::max(usual_kev, kThinHeadroom * behind_thin_kev);
}

// ---- the dose -----------------------------------------------------------------------------------------

double XrayGenerator::kerma_rate_mGy_min() {
  constexpr double kMilli = 1e-3;
  return kMilli * technique_.mas * beam(technique_.kvp).reference_uGy_per_mas * options_.pulses_per_s *
         kSecondsPerMinute;
}

void XrayGenerator::count_pulse(double open_area_cm2) {
  const double kerma_uGy = technique_.mas * beam(technique_.kvp).reference_uGy_per_mas;
  const CArm& c_arm = options_.c_arm;
  const double closer = reference_distance_mm(c_arm) / c_arm.distances.source_detector_mm;
  constexpr double kMilli = 1e-3, kMicro = 1e-6;
  dose_.air_kerma_mGy += kMilli * kerma_uGy;
  dose_.dap_Gycm2 += kMicro * kerma_uGy * open_area_cm2 * closer * closer;
  ++dose_.pulses;
  if (options_.dose == DoseLevel::cine)
    ++dose_.images;
  else
    dose_.fluoroscopy_s += 1 / options_.pulses_per_s;
}

}  // namespace xraycast
