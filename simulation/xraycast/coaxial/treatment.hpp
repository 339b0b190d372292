#pragma once

#include "xraycast/catheter/yielding_walls.hpp"
#include "xraycast/coaxial/placed_stent.hpp"
#include "xraycast/mechanics/stent_model.hpp"

#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace xraycast {

/// A balloon's inflation, or the release of a stent that opens itself: what was done to a vessel, where, and
/// what it led to. Diameters are of the lumen.
struct Treatment {
  std::size_t instrument = 0;
  std::string device;  ///< the instrument's name
  double from_s = 0;   ///< as Instruments::time_s(): of its beginning
  double to_s = 0;     ///< when the balloon was folded again, or all of the stent free or, until then, now
  bool is_over = false;
  int branch = 0;                 ///< of the vessel in which most of it was
  double from_mm = 0, to_mm = 0;  ///< that length, from the branch's first point, at the largest pressure
  double middle_mm =
      0;  ///< where the balloon's middle was or, in another vessel, that length's, or the stent's
  double largest_bar = 0;
  double opened_mm = 0;   ///< the balloon's diameter at that pressure, or the stent's, the mean of its rings
  double occluded_s = 0;  ///< for so long it filled its vessel (kFillsLumen), in which no blood flows then
  double least_before_mm = 0;  ///< diameter in that length
  double least_after_mm = 0;   ///< now or, once it is over, then
  /// The mean of the diameters before, kReference_mm beyond either end of that length.
  double reference_mm = 0;
  /// From the narrowest place before, in that length and kReference_mm beyond it, to the middle, along the
  /// vessel; positive where the middle lies beyond that place.
  double off_narrowest_mm = 0;
  std::optional<StentModel> stent{};  ///< that it opened, or released, and left there
  // Of that, once it is over.
  Malapposition malapposition{};
  double stent_mm = 0;  ///< its diameter, the mean of its rings
  double stent_length_mm = 0;
  double outward_N_mm =
      0;  ///< of one that opens itself, by which it presses on the wall, the mean of its rings
  int sheathed_rings = 0;  ///< of that, which were never free

  static constexpr double kReference_mm = 5;

  double residual_stenosis() const { return 1 - least_after_mm / reference_mm; }
  double stenosis_before() const { return 1 - least_before_mm / reference_mm; }
  double balloon_to_vessel() const { return opened_mm / reference_mm; }
  bool is_release() const { return stent && stent->expands_itself(); }
  /// Of a stent that opens itself: its diameter, free, over the vessel's.
  double oversizing() const { return stent->diameter_mm / reference_mm; }
};

/// The walls of a vessel tree while balloons and stents work on them, and a list of what they did.
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
  /// A stent that opens itself, of which rings are free. They lie one behind the other from its far end on,
  /// which stays where the first one opened.
  struct Unsheathed {
    std::size_t instrument = 0;
    const std::string* device = nullptr;
    const StentModel* stent = nullptr;
    int free_rings = 0;
    int branch = 0;         ///< in which most of it lies
    double far_end_mm = 0;  ///< from that branch's first point
    double towards_hub =
        -1;  ///< 1 where the branch goes on from the far end to the hub, -1 where it comes from there
  };
  /// All balloons that are filled at a time, and the stents on their way out of their sheaths. False where no
  /// wall has moved.
  bool work(std::span<const Filled> balloons, std::span<const Unsheathed> stents, double time_s);

  /// An instrument is out of the body: what of its stent is not free is with it.
  void take_out(std::size_t instrument);

  const YieldingWalls& walls() const { return walls_; }
  const std::vector<Treatment>& list() const { return list_; }
  const std::vector<PlacedStent>& stents() const { return stents_; }

 private:
  Treatment& of(std::size_t instrument, const std::string& device, double time_s);
  std::size_t number_of(const Treatment& treatment) const {
    return static_cast<std::size_t>(&treatment - list_.data());
  }
  void place(Treatment& treatment, const Filled& balloon);
  void measure(Treatment& treatment) const;
  void free_rings(Treatment& treatment, const Unsheathed& unsheathed);
  void free_ring(PlacedStent& stent, const Unsheathed& unsheathed) const;
  PlacedStent& stent_of(const Treatment& treatment);
  bool fills(const Filled& balloon) const;

  void open_stents(std::span<const Filled> balloons);
  static void open_ring(PlacedStent& stent, std::size_t ring, double left_mm);
  bool goes_on(const Treatment& treatment, std::span<const Filled> balloons);
  void end(Treatment& treatment);
  void tell(const PlacedStent& stent);
  std::vector<YieldingWalls::Opening> openings_of(std::span<const Filled> balloons) const;

  YieldingWalls walls_;
  std::vector<Treatment> list_;
  std::vector<PlacedStent> stents_;
  std::vector<std::shared_ptr<const LumenDistanceField>> before_;  ///< of each
  std::vector<bool> occludes_;                                     ///< each, as of the last time
};

}  // namespace xraycast
