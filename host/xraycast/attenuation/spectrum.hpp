#pragma once

#include "xraycast/attenuation/materials.hpp"
#include "xraycast/attenuation/opacity.hpp"
#include "xraycast/attenuation/solid_material.hpp"

#include <array>
#include <span>
#include <string>
#include <variant>
#include <vector>

namespace xraycast {

/// The photon spectrum of a filtered X-ray beam: the fluence per energy bin.
class Spectrum {
 public:
  struct Bin {
    double energy_kev;
    double fluence;  ///< photons in the bin, in any unit
    bool operator==(const Bin&) const = default;
  };
  static constexpr std::size_t kMaxBins = 1000;

  /// Throws InputError, with `name` in front, unless there are 1 to 1000 bins, strictly ascending within 1 to
  /// 800 keV, with finite fluences >= 0, not all of them 0.
  Spectrum(std::string name, std::vector<Bin> bins);

  /// `80`, `100` or `120`: a tube at that constant voltage in kV, with a tungsten anode of 10 degrees behind
  /// 2.5 mm of aluminium, the least total filtration that IEC 60601-1-3 allows, in bins of 1 keV. Half-value
  /// layers are 3.07, 3.91 and 4.73 mm of aluminium, where the radiation qualities RQR 6, 8 and 9 of IEC
  /// 61267:2005 have 3.01, 3.97 and 5.00 mm.
  ///
  /// Anything else is a file of two columns, energy in keV and photons in that bin, with blank lines and
  /// comments after `#`. Throws InputError, naming file and line.
  ///
  /// The model is D. M. Tucker, G. T. Barnes and D. P. Chakraborty, Semiempirical model for generating
  /// tungsten target x-ray spectra, Med. Phys. 18, 1991, 211-218: bremsstrahlung and K lines, both made at
  /// varying depth in the anode and filtered by it. L lines (8 to 12 keV) do not pass the filter, and are
  /// left out.
  static Spectrum named(const std::string& kvp_or_file);

  /// {"name": "80 kVp", "bins": [[10.5, 0.001], ...]}. Throws InputError; `origin` precedes the message.
  static Spectrum from_json(const std::string& text, const std::string& origin);
  std::string to_json() const;

  const std::string& name() const { return name_; }
  std::span<const Bin> bins() const { return bins_; }

  bool operator==(const Spectrum&) const = default;

 private:
  std::string name_;
  std::vector<Bin> bins_;
};

/// What a scan's voxels do to X-rays.
using Attenuation = std::variant<Opacity, Spectrum>;

/// Opacity::named, or Spectrum::named after `spectrum:`.
Attenuation attenuation_named(const std::string& name_or_file);

/// The attenuation of a spectrum as measured by a detector that absorbs the whole energy of every photon,
/// which fluoroscopy detectors approximate: they integrate energy and do not count photons. Without scatter.
///
/// Low energies are attenuated more, so that each layer hardens the beam for the next: the optical depth
/// -ln(transmission) of two layers is less than the sum of theirs. Masses add up, so they are summed along a
/// whole ray first.
class SpectrumModel {
 public:
  explicit SpectrumModel(const Spectrum& spectrum, std::span<const Material> materials = kMaterials,
                         std::span<const SolidMaterial> solids = {});

  /// The fraction of the energy that is transmitted: sum of S E exp(-sum of mu/rho(E) x) / sum of S E, over
  /// the bins, with S photons of energy E each and the mass x of each material in g/cm2, in the constructor's
  /// order, solids last.
  double transmission(std::span<const double> g_cm2) const;

  /// -ln(transmission) of many rays through kMaterials, and the constructor's solids in g/cm2, on all cores.
  std::vector<float> tau(const MaterialDepths& depths, std::span<const std::vector<float>> solids = {}) const;

  /// For computation elsewhere (shaders, kernels): every bin's share of the energy and, for models of up to
  /// three materials, mu/rho of each in cm2/g.
  std::vector<std::array<float, 4>> table() const;

 private:
  static constexpr std::size_t kRaysAtOnce = 64;
  void find_tau(const MaterialDepths& depths, std::span<const std::vector<float>> solids, std::size_t first,
                std::size_t count, float* tau) const;

  std::vector<double> weights_;             ///< share of every bin in the energy
  std::vector<std::vector<double>> cm2_g_;  ///< for each material, mu/rho of every bin
};

}  // namespace xraycast
