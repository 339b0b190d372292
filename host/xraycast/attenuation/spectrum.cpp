#include "xraycast/attenuation/spectrum.hpp"

#include "xraycast/attenuation/tube_spectrum.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/json_text.hpp"
#include "xraycast/base/parallel.hpp"
#include "xraycast/base/remedy.hpp"
#include "xraycast/base/whole_file.hpp"

#include <nlohmann/json.hpp>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <sstream>
#include <xraylib.h>

namespace xraycast {
namespace {

constexpr double kLowest_kev = 1, kHighest_kev = 800;  // range of xraylib

// ---- the tube, after Tucker, Barnes and Chakraborty

constexpr int kTubes_kv[] = {80, 100, 120};
constexpr double kAnodeAngle_rad = 10 * std::numbers::pi / 180;
constexpr double kFilter_g_cm2 = 0.25 * 2.699;  // aluminium
constexpr int kTungsten = 74;  // without the tenth of rhenium, element 75, in the paper's anode

/// The mean of f over [0, 1], by the midpoint rule.
template <typename Function>
double mean_over_unit(const Function& f) {
  constexpr int kSteps = 200;  // every bin is good to 0.2 %
  double sum = 0;
  for (int i = 0; i < kSteps; ++i) sum += f((i + 0.5) / kSteps);
  return sum / kSteps;
}

/// The depth in the anode at which electrons have slowed down to `electron_kev`, by the law of Thomson and
/// Whiddington. Its constant is a line through the values of R. Birch and M. Marshall (Phys. Med. Biol. 24,
/// 1979, 505-517) from 50 to 200 kV, good to 1.5 %.
double depth_g_cm2(double tube_kv, double electron_kev) {
  return (tube_kv * tube_kv - electron_kev * electron_kev) / (1e6 * (0.39 + 0.00304 * tube_kv));
}

/// Attenuation of photons on their way out of the anode, for each g/cm2 of depth.
double way_out_cm2_g(double energy_kev) {
  return mass_attenuation_cm2_g("W", energy_kev) / std::sin(kAnodeAngle_rad);
}

/// Photons per electron and keV.
double bremsstrahlung(double tube_kv, double energy_kev) {
  constexpr double kFineStructure = 1 / 137.036;
  // alpha r_e^2 Z^2 per gram, in which the cross section is measured.
  static const double unit_cm2_g =
      kFineStructure * RE2 * AVOGNUM * kTungsten * kTungsten / AtomicWeight(kTungsten, nullptr);
  // The paper's A0 and A1 times 1000: only then does the output match real tubes, some 90 uGy/mAs of air
  // kerma at 1 m for 100 kVp, and the ratio to the K lines.
  const double strength = 36.85 + 0.029 * tube_kv;
  const double attenuation_cm2_g = way_out_cm2_g(energy_kev);
  const double mean = mean_over_unit([&](double share) {
    const double electron_kev = std::lerp(energy_kev, tube_kv, share), u = energy_kev / electron_kev;
    const double shape = 1 + u * (-5.049 + u * (10.847 + u * (-10.516 + u * 3.842)));
    const double stopping_kev_cm2_g = 2024.1 + 10361 * std::exp(-0.04695 * electron_kev);
    return strength * shape * (electron_kev + MEC2) / electron_kev / stopping_kev_cm2_g *
           std::exp(-attenuation_cm2_g * depth_g_cm2(tube_kv, electron_kev));
  });
  return unit_cm2_g / energy_kev * (tube_kv - energy_kev) * mean;
}

/// The K lines of a tube above the K edge, 69.5 kV; fluences are photons per electron. They are made down to
/// where electrons can no longer free a K electron, most of them near the surface.
std::vector<Spectrum::Bin> k_lines(double tube_kv) {
  const double edge_kev = EdgeEnergy(kTungsten, K_SHELL, nullptr);
  if (tube_kv <= edge_kev) return {};
  const double made = 1.349e-3 * std::pow(tube_kv / edge_kev - 1, 1.648);
  const double deepest_g_cm2 = depth_g_cm2(tube_kv, edge_kev);
  std::vector<Spectrum::Bin> lines;
  for (const int line : {KL3_LINE, KL2_LINE, KM3_LINE, KM2_LINE, KN3_LINE, KN2_LINE}) {
    const double energy_kev = LineEnergy(kTungsten, line, nullptr);
    const double attenuation = way_out_cm2_g(energy_kev) * deepest_g_cm2;
    const double leaving = mean_over_unit(
        [&](double depth) { return 1.5 * (1 - depth * depth) * std::exp(-attenuation * depth); });
    lines.push_back({energy_kev, made * RadRate(kTungsten, line, nullptr) * leaving});
  }
  return lines;
}

/// Photons per electron behind the inherent filter.
Spectrum filtered_tube(int tube_kv) {
  constexpr int kLowest_kv = 10;  // one photon in 10^7 of less energy passes the filter
  std::vector<Spectrum::Bin> bins;
  for (int kev = kLowest_kv; kev < tube_kv; ++kev)
    bins.push_back({kev + 0.5, bremsstrahlung(tube_kv, kev + 0.5)});
  for (const auto& [energy_kev, photons] : k_lines(tube_kv))
    bins[static_cast<std::size_t>(energy_kev) - kLowest_kv].fluence += photons;
  for (auto& [energy_kev, fluence] : bins)
    fluence *= std::exp(-mass_attenuation_cm2_g("Al", energy_kev) * kFilter_g_cm2);
  return {fmt::format("{} kVp", tube_kv), std::move(bins)};
}

// ---- files

void validate(const std::string& name, const std::vector<Spectrum::Bin>& bins) {
  if (bins.empty() || bins.size() > Spectrum::kMaxBins)
    throw InputError("{}: {} energies, but a spectrum must have 1 to {}", name, bins.size(),
                     Spectrum::kMaxBins);
  for (std::size_t i = 0; i < bins.size(); ++i) {
    const auto [energy_kev, fluence] = bins[i];
    if (!(energy_kev >= kLowest_kev && energy_kev <= kHighest_kev))
      throw InputError("{}: energy {} keV is outside {} to {} keV", name, energy_kev, kLowest_kev,
                       kHighest_kev);
    if (i > 0 && energy_kev <= bins[i - 1].energy_kev)
      throw InputError("{}: energy {} keV is not above the one before it, {} keV; sort the lines", name,
                       energy_kev, bins[i - 1].energy_kev);
    if (!std::isfinite(fluence) || fluence < 0)
      throw InputError("{}: the fluence at {} keV is {}, but must be finite and not negative", name,
                       energy_kev, fluence);
  }
  if (std::ranges::all_of(bins, [](const auto& bin) { return bin.fluence == 0; }))
    throw InputError("{}: all fluences are 0; at least one must be above 0", name);
}

Spectrum read_columns(const std::string& file) {
  std::istringstream text(read_whole_file(file));
  std::vector<Spectrum::Bin> bins;
  int number = 1;
  for (std::string line; std::getline(text, line); ++number) {
    line.erase(std::min(line.find('#'), line.size()));
    std::istringstream columns(line);
    columns >> std::ws;
    if (columns.eof()) continue;
    Spectrum::Bin bin{};
    if (!(columns >> bin.energy_kev >> bin.fluence) || !(columns >> std::ws).eof())
      throw InputError("{}: line {} is not two numbers, energy in keV and fluence", file, number);
    bins.push_back(bin);
  }
  return {file, std::move(bins)};
}

}  // namespace

Spectrum::Spectrum(std::string name, std::vector<Bin> bins) : name_(std::move(name)), bins_(std::move(bins)) {
  validate(name_, bins_);
}

Spectrum Spectrum::named(const std::string& kvp_or_file) {
  for (const int tube_kv : kTubes_kv)
    if (kvp_or_file == std::to_string(tube_kv)) return filtered_tube(tube_kv);
  std::error_code error;
  if (!std::filesystem::is_regular_file(kvp_or_file, error))
    throw InputError("spectrum:{}: give a tube voltage of {} kVp, or a file of energies in keV and fluences",
                     excerpt(kvp_or_file), fmt::join(kTubes_kv, ", "));
  return with_remedy(kvp_or_file, "correct the file", [&] { return read_columns(kvp_or_file); });
}

Attenuation attenuation_named(const std::string& name_or_file) {
  const std::string prefix = "spectrum:";
  if (name_or_file.starts_with(prefix)) return Spectrum::named(name_or_file.substr(prefix.size()));
  return Opacity::named(name_or_file);
}

Spectrum tube_spectrum(int tube_kv, const BeamFilter& added) {
  if (tube_kv < kLowestTube_kv || tube_kv > kHighestTube_kv)
    throw InputError("{} kVp: the tube model is valid from {} to {} kVp; choose a voltage in this range",
                     tube_kv, kLowestTube_kv, kHighestTube_kv);
  constexpr double kElectronsPerMas = 6.241509e15, kMetre_cm = 100;
  // Over the whole sphere the model gives 111 uGy/mAs at 1 m for 100 kVp, real tubes some 90: their anodes
  // are rough and their housings have windows.
  constexpr double kRealTubes = 0.81;
  constexpr double kPerMasAndCm2 =
      kRealTubes * kElectronsPerMas / (4 * std::numbers::pi * kMetre_cm * kMetre_cm);
  constexpr double kAluminium_g_cm3 = 2.699, kCopper_g_cm3 = 8.96, kMm_cm = 0.1;
  const Spectrum inherent = filtered_tube(tube_kv);
  std::vector<Spectrum::Bin> bins(inherent.bins().begin(), inherent.bins().end());
  for (auto& [energy_kev, fluence] : bins) {
    const double depth =
        kMm_cm * (added.aluminium_mm * kAluminium_g_cm3 * mass_attenuation_cm2_g("Al", energy_kev) +
                  added.copper_mm * kCopper_g_cm3 * mass_attenuation_cm2_g("Cu", energy_kev));
    fluence *= kPerMasAndCm2 * std::exp(-depth);
  }
  return {fmt::format("{} kVp", tube_kv), std::move(bins)};
}

Spectrum Spectrum::from_json(const std::string& text, const std::string& origin) {
  try {
    const auto json = parse_json(text, origin);
    std::vector<Bin> bins;
    for (const auto& [energy_kev, fluence] : json.at("bins").get<std::vector<std::array<double, 2>>>())
      bins.push_back({energy_kev, fluence});
    validate(origin, bins);
    return {json.at("name").get<std::string>(), std::move(bins)};
  } catch (const nlohmann::json::exception&) {
    throw InputError("{}: not a spectrum of energies in keV and fluences", origin);
  }
}

std::string Spectrum::to_json() const {
  nlohmann::ordered_json json{{"name", name_}, {"bins", nlohmann::json::array()}};
  for (const Bin& bin : bins_) json["bins"].push_back({bin.energy_kev, bin.fluence});
  return json.dump(-1, ' ', false,
                   nlohmann::json::error_handler_t::replace);  // a file's name need not be UTF-8
}

SpectrumModel::SpectrumModel(const Spectrum& spectrum, std::span<const Material> materials,
                             std::span<const SolidMaterial> solids)
    : cm2_g_(materials.size() + solids.size()) {
  double energy = 0;
  for (const auto& [energy_kev, fluence] : spectrum.bins()) energy += energy_kev * fluence;
  for (const auto& [energy_kev, fluence] : spectrum.bins()) {
    if (fluence == 0) continue;
    weights_.push_back(energy_kev * fluence / energy);
    for (std::size_t m = 0; m < materials.size(); ++m)
      cm2_g_[m].push_back(mass_attenuation_cm2_g(materials[m].xraylib_name, energy_kev));
    for (std::size_t m = 0; m < solids.size(); ++m)
      cm2_g_[materials.size() + m].push_back(solids[m].cm2_g(energy_kev));
  }
}

double SpectrumModel::transmission(std::span<const double> g_cm2) const {
  double passed = 0;
  for (std::size_t i = 0; i < weights_.size(); ++i) {
    double depth = 0;
    for (std::size_t m = 0; m < cm2_g_.size(); ++m) depth += cm2_g_[m][i] * g_cm2[m];
    passed += weights_[i] * std::exp(-depth);
  }
  return passed;
}

std::vector<float> SpectrumModel::tau(const MaterialDepths& depths,
                                      std::span<const std::vector<float>> solids) const {
  const std::size_t rays = depths[0].size();
  std::vector<float> tau(rays);
  constexpr std::size_t kRun = 4096;  // rays; long enough to be worth a thread
  parallel_for(static_cast<std::int64_t>((rays + kRun - 1) / kRun), [&](std::int64_t run) {
    const std::size_t first = static_cast<std::size_t>(run) * kRun;
    for (std::size_t ray = first; ray < std::min(first + kRun, rays); ray += kRaysAtOnce)
      find_tau(depths, solids, ray, std::min(kRaysAtOnce, rays - ray), tau.data() + ray);
  });
  return tau;
}

/// Relative to the bin that passes best, so that no ray is too long for 32 bits.
void SpectrumModel::find_tau(const MaterialDepths& depths, std::span<const std::vector<float>> solids,
                             std::size_t first, std::size_t count, float* tau) const {
  using Rays = Eigen::Array<float, kRaysAtOnce, 1>;
  const auto rays_of = [&](const std::vector<float>& all) {
    Rays rays = Rays::Zero();
    std::copy_n(all.data() + first, count, rays.data());
    return rays;
  };
  std::array<Rays, kMaterials.size()> g_cm2;
  for (std::size_t m = 0; m < g_cm2.size(); ++m) g_cm2[m] = rays_of(depths[m]);
  const auto depth = [&](std::size_t bin) {
    Rays sum = static_cast<float>(cm2_g_[0][bin]) * g_cm2[0] + static_cast<float>(cm2_g_[1][bin]) * g_cm2[1] +
               static_cast<float>(cm2_g_[2][bin]) * g_cm2[2];
    for (std::size_t s = 0; s < solids.size(); ++s)
      sum += static_cast<float>(cm2_g_[kMaterials.size() + s][bin]) * rays_of(solids[s]);
    return sum;
  };
  Rays least = depth(0), passed = Rays::Zero();
  float all = 0;  // as 32 bits add the weights up, so that nothing attenuates nothing
  for (std::size_t bin = 1; bin < weights_.size(); ++bin) least = least.min(depth(bin));
  for (std::size_t bin = 0; bin < weights_.size(); ++bin) {
    const auto weight = static_cast<float>(weights_[bin]);
    passed += weight * (least - depth(bin)).exp();
    all += weight;
  }
  const Rays found = (least - (passed / all).log()).max(0);
  std::copy_n(found.data(), count, tau);
}

std::vector<std::array<float, 4>> SpectrumModel::table() const {
  std::vector<std::array<float, 4>> rows(weights_.size());
  for (std::size_t bin = 0; bin < rows.size(); ++bin) {
    rows[bin][0] = static_cast<float>(weights_[bin]);
    for (std::size_t m = 0; m < std::min<std::size_t>(3, cm2_g_.size()); ++m)
      rows[bin][m + 1] = static_cast<float>(cm2_g_[m][bin]);
  }
  return rows;
}

}  // namespace xraycast
