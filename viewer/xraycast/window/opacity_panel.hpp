#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace xraycast {

/// An opacity's curve over a scan's HU histogram, to be dragged by its knots.
class OpacityPanel {
 public:
  /// What the mouse did in this frame.
  struct Edit {
    int knot = -1;  ///< -1: nothing
    double mu_per_mm = 0;
    bool began = false;  ///< the drag starts here
  };

  /// Draws the panel within the current ImGui window. `why_not` says why nothing can be dragged; empty: it
  /// can. The histogram's bins are `bin_hu` wide, from -1024 HU on.
  Edit draw(std::span<const double> knots_hu, std::span<const double> mu_per_mm,
            std::span<const std::int64_t> histogram, int bin_hu, const std::string& why_not);

 private:
  int dragged_ = -1;
};

/// mu at given HU under one of kOpacityPresets.
std::vector<double> preset_mu_per_mm(const std::string& preset, std::span<const double> knots_hu);
inline constexpr const char* kOpacityPresets[] = {"paper",   "bone", "soft tissue",
                                                  "vessels", "lung", "subtracted"};

}  // namespace xraycast
