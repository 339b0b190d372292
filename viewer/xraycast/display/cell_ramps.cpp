#include "xraycast/display/cell_ramps.hpp"

#include <cmath>

namespace xraycast {

void CellRamps::row(const float* cells, float weight, int j, float* out) const {
  const auto side = static_cast<float>(cell_);
  const float y =
      std::clamp((static_cast<float>(j) + 0.5f) / side - 0.5f, 0.0f, static_cast<float>(rows_ - 1));
  const int above = std::min(static_cast<int>(y), std::max(0, rows_ - 2)),
            below = std::min(above + 1, rows_ - 1);
  const float part = y - static_cast<float>(above);
  const float *const upper = cells + static_cast<std::ptrdiff_t>(above) * columns_,
                     *const lower = cells + static_cast<std::ptrdiff_t>(below) * columns_;
  const auto at = [&](int column) {
    const int inside = std::min(column, columns_ - 1);
    return weight * std::lerp(upper[inside], lower[inside], part);
  };
  // Between two middles the row is a ramp; the first one begins half a cell before the row.
  thread_local PixelPlane ramps;
  ramps.resize(static_cast<std::size_t>(columns_ + 1) * static_cast<std::size_t>(cell_));
  float from = at(0);
  for (int column = 0; column <= columns_; ++column) {
    const float to = at(column), slope = (to - from) / side;
    float* const ramp = ramps.data() + static_cast<std::ptrdiff_t>(column) * cell_;
    for (int i = 0; i < cell_; ++i) ramp[i] = from + slope * (static_cast<float>(i) + 0.5f);
    from = to;
  }
  std::copy_n(ramps.data() + cell_ / 2, size_.width, out);
}

}  // namespace xraycast
