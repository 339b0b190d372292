#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

namespace xraycast {

/// The attenuation of each CT number: a piecewise-linear function from Hounsfield units to the linear
/// attenuation coefficient mu in 1/mm, constant beyond its end knots.
class Opacity {
 public:
  struct Knot {
    double hu;
    double mu_per_mm;
    bool operator==(const Knot&) const = default;
  };
  static constexpr std::size_t kMaxKnots = 64;

  /// Throws InputError, with `name` in front, unless there are 1 to 64 knots, strictly ascending in HU within
  /// [-1024, 32767], with finite mu >= 0.
  Opacity(std::string name, std::vector<Knot> knots);

  /// mu = 0.02/mm (HU / 1024 + 1): equation 1 of the X-ray casting paper, and the default.
  static Opacity paper();

  /// mu = 0.02/mm HU / 1024: as `paper`, but without the attenuation of water, for a subtracted angiogram.
  static Opacity subtracted();

  /// 0 up to -1000 HU, 0.0192/mm at 0 HU and 0.0573/mm at 1000 HU, linear between and above: water and bone
  /// at about 70 keV, as in nanodrr.
  static Opacity bilinear();

  /// {"name": "bone", "unit": "1/mm", "knots": [[-1000, 0], [150, 0], [1000, 0.06]]}. Throws InputError
  /// naming the field; `origin` (a file name) precedes the message.
  static Opacity from_json(const std::string& text, const std::string& origin);

  /// `paper`, `bilinear`, `subtracted`, or the name of a JSON file.
  static Opacity named(const std::string& name_or_file);

  std::string to_json() const;

  const std::string& name() const { return name_; }
  std::span<const Knot> knots() const { return knots_; }
  double mu_per_mm(double hu) const;

  bool operator==(const Opacity&) const = default;

 private:
  std::string name_;
  std::vector<Knot> knots_;
};

}  // namespace xraycast
