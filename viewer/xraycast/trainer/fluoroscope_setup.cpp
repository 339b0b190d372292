#include "xraycast/trainer/fluoroscope_setup.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/trainer/setup_numbers.hpp"

#include <algorithm>
#include <cmath>
#include <type_traits>

namespace xraycast {
namespace {

constexpr double kStep_kev = 1;

/// Calls each(number) for all numbers of what is set, in the order of `packed`; `list(items, each_of)` for
/// lists.
template <typename Setup, typename Each, typename List>
void for_numbers(Setup& setup, const Each& each, const List& list) {
  auto& options = setup.options;
  auto& c_arm = options.c_arm;
  each(c_arm.distances.source_axis_mm);
  each(c_arm.distances.source_detector_mm);
  auto& tube = c_arm.tube;
  for (auto* number :
       {&tube.focal_spot_mm, &tube.aluminium_mm, &tube.copper_mm, &tube.lowest_kvp, &tube.highest_kvp,
        &tube.lowest_ma, &tube.highest_ma, &tube.power_kw, &tube.pulse_ms, &c_arm.table_mm})
    each(*number);
  auto& detector = c_arm.detector;
  for (auto* number :
       {&detector.width_mm, &detector.height_mm, &detector.pixel_mm, &detector.scintillator_g_cm2,
        &detector.cover_mm, &detector.electronic_noise_kev, &detector.blur.narrow_mm, &detector.blur.wide_mm,
        &detector.blur.wide_share, &c_arm.dose.low_uGy, &c_arm.dose.normal_uGy, &c_arm.dose.cine_uGy})
    each(*number);
  each(detector.is_round);
  each(detector.bits);
  each(c_arm.grid->primary);
  each(c_arm.grid->scatter);
  list(detector.lag, [&](auto& trap) {
    each(trap.fraction);
    each(trap.time_s);
  });
  list(c_arm.fields_mm, each);
  each(options.field_mm);
  each(options.dose);
  each(options.pulses_per_s);
  each(options.seed);
  each(c_arm.compression);
  each(setup.water_per_mm);
}

double rounded_to_float(double number) { return static_cast<double>(static_cast<float>(number)); }

/// The number of an energy that is a whole number of steps above the first.
std::size_t energy_number(double energy_kev, double first_kev) {
  const double number = (energy_kev - first_kev) / kStep_kev;
  if (std::abs(number - std::round(number)) > 1e-6)
    throw Error("a tube's spectrum has an energy of {} keV between those that a page takes", energy_kev);
  return static_cast<std::size_t>(std::lround(number));
}

void add_beams(const TubeBeams& tube, std::vector<double>& numbers) {
  double first_kev = INFINITY;
  for (const FluoroscopyBeam& beam : tube.beams)
    first_kev = std::min(first_kev, beam.spectrum.bins().front().energy_kev);
  std::vector<double> water_cm2_g;
  for (const FluoroscopyBeam& beam : tube.beams)
    for (const DetectedSpectrum::Bin& bin : beam.spectrum.bins()) {
      const std::size_t number = energy_number(bin.energy_kev, first_kev);
      water_cm2_g.resize(std::max(water_cm2_g.size(), number + 1));
      water_cm2_g[number] = bin.cm2_g.front();
    }
  numbers.insert(numbers.end(),
                 {tube.absorbed_kev_per_uGy, 1.0 * tube.lowest_kvp, static_cast<double>(tube.beams.size()),
                  static_cast<double>(water_cm2_g.size()), first_kev});
  numbers.insert(numbers.end(), water_cm2_g.begin(), water_cm2_g.end());
  for (const FluoroscopyBeam& beam : tube.beams) {
    const auto bins = beam.spectrum.bins();
    const std::size_t first = energy_number(bins.front().energy_kev, first_kev),
                      count = energy_number(bins.back().energy_kev, first_kev) - first + 1;
    std::vector<double> absorbed(count);
    for (const DetectedSpectrum::Bin& bin : bins)
      absorbed[energy_number(bin.energy_kev, first_kev) - first] = rounded_to_float(bin.absorbed);
    numbers.insert(numbers.end(), {beam.reference_uGy_per_mas, beam.limited_uGy_per_mas,
                                   static_cast<double>(first), static_cast<double>(count)});
    numbers.insert(numbers.end(), absorbed.begin(), absorbed.end());
  }
}

TubeBeams beams_of(SetupNumbers& numbers) {
  TubeBeams tube;
  tube.absorbed_kev_per_uGy = numbers.real();
  tube.lowest_kvp = numbers.index();
  const std::size_t beams = numbers.count(), energies = numbers.count();
  const double first_kev = numbers.real();
  std::vector<double> water_cm2_g(energies);
  for (double& one : water_cm2_g) one = numbers.real();
  for (std::size_t b = 0; b < beams; ++b) {
    const double reference = numbers.real(), limited = numbers.real();
    const std::size_t first = numbers.count(), count = numbers.count();
    if (first + count > energies) throw InputError("fluoroscope: a beam has more energies than there are");
    std::vector<DetectedSpectrum::Bin> bins;
    for (std::size_t i = first; i < first + count; ++i)
      bins.push_back({first_kev + kStep_kev * static_cast<double>(i), numbers.real(), {water_cm2_g[i]}});
    tube.beams.push_back({DetectedSpectrum(std::move(bins)), reference, limited});
  }
  return tube;
}

}  // namespace

const FluoroscopyBeam& TubeBeams::at(int kvp) const {
  if (kvp < lowest_kvp || kvp - lowest_kvp >= std::ssize(beams))
    throw Error("there is no beam of {} kVp", kvp);
  return beams[static_cast<std::size_t>(kvp - lowest_kvp)];
}

FluoroscopeSetup fluoroscope_setup(const FluoroscopyOptions& options, double water_per_mm) {
  FluoroscopeSetup setup{.options = options, .water_per_mm = water_per_mm};
  const CArm& c_arm = options.c_arm;
  setup.beams.absorbed_kev_per_uGy = absorbed_kev_per_uGy(c_arm.detector);
  setup.beams.lowest_kvp = static_cast<int>(c_arm.tube.lowest_kvp);
  for (int kvp = setup.beams.lowest_kvp; kvp <= static_cast<int>(c_arm.tube.highest_kvp); ++kvp)
    setup.beams.beams.emplace_back(c_arm, kvp);
  return setup;
}

std::vector<double> packed(const FluoroscopeSetup& setup) {
  FluoroscopeSetup whole{.options = setup.options, .water_per_mm = setup.water_per_mm};
  whole.options.c_arm.compression = whole.options.range_compression();
  if (!whole.options.c_arm.grid) whole.options.c_arm.grid.emplace();  // one that lets all through
  std::vector<double> numbers;
  const auto add = [&](const auto& number) { numbers.push_back(static_cast<double>(number)); };
  for_numbers(whole, add, [&](const auto& items, const auto& add_item) {
    numbers.push_back(static_cast<double>(items.size()));
    for (const auto& item : items) add_item(item);
  });
  add_beams(setup.beams, numbers);
  return numbers;
}

FluoroscopeSetup fluoroscope_setup_of(std::span<const double> packed) {
  SetupNumbers numbers("fluoroscope", packed);
  FluoroscopeSetup setup;
  setup.options.c_arm.grid.emplace();
  const auto take = [&](auto& number) {
    using Number = std::remove_reference_t<decltype(number)>;
    if constexpr (std::is_same_v<Number, double>)
      number = numbers.real();
    else
      number = static_cast<Number>(numbers.index());
  };
  for_numbers(setup, take, [&](auto& items, const auto& take_item) {
    items.resize(numbers.count());
    for (auto& item : items) take_item(item);
  });
  setup.beams = beams_of(numbers);
  check(setup.options);
  return setup;
}

View pulse_view_of(std::span<const double, 10> n) {
  View view{.lao_rad = n[0],
            .cranial_rad = n[1],
            .centre_mm = {n[2], n[3], n[4]},
            .width = static_cast<int>(n[5]),
            .height = static_cast<int>(n[6]),
            .pixel_mm = n[7]};
  if (n[8] > 0) view.cone = Cone{n[8], n[9]};
  return view;
}

}  // namespace xraycast
