#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace xraycast {

/// The transfer function: an opacity's curve over a scan's HU histogram, edited by dragging its knots.
class OpacityPanel {
 public:
  /// The edit by the mouse in this frame.
  struct Edit {
    int knot = -1;  ///< -1: nothing
    double mu_per_mm = 0;
    bool began = false;  ///< the drag starts in this frame
  };

  /// Draws the panel within the current ImGui window. `why_not` says why the curve cannot be edited; empty:
  /// it can. The histogram's bins are `bin_hu` wide, from -1024 HU on.
  Edit draw(std::span<const double> knots_hu, std::span<const double> mu_per_mm,
            std::span<const std::int64_t> histogram, int bin_hu, const std::string& why_not);

 private:
  int dragged_ = -1;
};

/// mu at given HU with one of kOpacityPresets.
std::vector<double> preset_mu_per_mm(const std::string& preset, std::span<const double> knots_hu);
inline constexpr const char* kOpacityPresets[] = {"paper",   "bone", "soft tissue",
                                                  "vessels", "lung", "subtracted"};

}  // namespace xraycast
