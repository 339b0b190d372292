#pragma once

#include "xraycast/catheter/yielding_walls.hpp"
#include "xraycast/mechanics/stent_model.hpp"

#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace xraycast {

/// A stent that was left in a vessel, along its centreline. It recoils as the walls do, by
/// YieldingWalls::kElasticStrain, and holds them open.
struct PlacedStent {
  StentModel model;
  int branch = 0;
  double middle_mm = 0;       ///< from the branch's first point
  double radius_mm = 0;       ///< of the middle of its struts
  std::size_t treatment = 0;  ///< that left it, of Treatments::list()

  double length_mm() const { return model.length_at_mm(2 * radius_mm); }
  double from_mm() const { return middle_mm - 0.5 * length_mm(); }
  double to_mm() const { return middle_mm + 0.5 * length_mm(); }
};

/// How far a stent's struts are from the wall.
struct Malapposition {
  static constexpr double kNoticed_mm = 0.2;
  double largest_mm = 0;
  double share = 0;  ///< of the stent's length, more than kNoticed_mm away
};
Malapposition malapposition(const PlacedStent& stent, const LumenDistanceField& walls);

/// A balloon's inflation: what was done to a vessel, where, and what it led to. Diameters are of the lumen.
struct Treatment {
  std::size_t instrument = 0;
  std::string device;  ///< the instrument's name
  double from_s = 0;   ///< as Instruments::time_s(): of its beginning
  double to_s = 0;     ///< when the balloon was folded again or, until then, now
  bool is_over = false;
  int branch = 0;                 ///< of the vessel in which most of it was
  double from_mm = 0, to_mm = 0;  ///< that length, from the branch's first point, at the largest pressure
  double middle_mm = 0;           ///< where the balloon's middle was or, in another vessel, that length's
  double largest_bar = 0;
  double opened_mm = 0;   ///< the balloon's diameter at that pressure
  double occluded_s = 0;  ///< for so long it filled its vessel (kFillsLumen), in which no blood flows then
  double least_before_mm = 0;  ///< diameter in that length
  double least_after_mm = 0;   ///< now or, once it is over, then
  /// The mean of the diameters before, kReference_mm beyond either end of that length.
  double reference_mm = 0;
  /// From the narrowest place before, in that length and kReference_mm beyond it, to the middle, along the
  /// vessel; positive where the middle lies beyond that place.
  double off_narrowest_mm = 0;
  std::optional<StentModel> stent{};  ///< that it opened, and left there
  Malapposition malapposition{};      ///< of that, once it is over
  double stent_mm = 0;                ///< its diameter then
  double stent_length_mm = 0;

  static constexpr double kReference_mm = 5;

  double residual_stenosis() const { return 1 - least_after_mm / reference_mm; }
  double stenosis_before() const { return 1 - least_before_mm / reference_mm; }
  double balloon_to_vessel() const { return opened_mm / reference_mm; }
};

/// The walls of a vessel tree while balloons work on them, and a list of what they did.
class Treatments {
 public:
  explicit Treatments(std::shared_ptr<const LumenDistanceField> field) : walls_(std::move(field)) {}

  /// Where a balloon lies: the lengths of vessels, one or more, and where its middle is.
  struct Place {
    std::vector<YieldingWalls::Opening> lengths{};
    int middle_branch = 0;
    double middle_mm = 0;  ///< from that branch's first point
  };
  /// A balloon that is filled.
  struct Filled {
    std::size_t instrument = 0;
    const std::string* device = nullptr;
    double bar = 0;
    Place place{};
    const StentModel* stent = nullptr;  ///< that it opens; none: it carries none
  };
  /// All balloons that are filled at a time. False where no wall has moved.
  bool work(std::span<const Filled> balloons, double time_s);

  const YieldingWalls& walls() const { return walls_; }
  const std::vector<Treatment>& list() const { return list_; }
  const std::vector<PlacedStent>& stents() const { return stents_; }

 private:
  Treatment& of(const Filled& balloon, double time_s);
  std::size_t number_of(const Treatment& treatment) const {
    return static_cast<std::size_t>(&treatment - list_.data());
  }
  void place(Treatment& treatment, const Filled& balloon, const LumenDistanceField& before) const;
  bool fills(const Filled& balloon) const;

  void open_stents(std::span<const Filled> balloons);
  void end(Treatment& treatment);
  std::vector<YieldingWalls::Opening> openings_of(std::span<const Filled> balloons) const;

  YieldingWalls walls_;
  std::vector<Treatment> list_;
  std::vector<PlacedStent> stents_;
  std::vector<std::shared_ptr<const LumenDistanceField>> before_;  ///< of each
  std::vector<bool> occludes_;                                     ///< each, as of the last time
};

}  // namespace xraycast
