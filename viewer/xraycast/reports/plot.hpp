#pragma once

#include "xraycast/base/picture_file.hpp"
#include "xraycast/scene/canvas.hpp"

#include <cstddef>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace xraycast {

/// One line of a plot: its name, its points in the order they are joined, its colour, where others than
/// the plot choose it, and the number of its pattern of dashes, of eight; 0 is a line without.
struct Curve {
  std::string name;
  std::vector<std::pair<double, double>> points;
  std::optional<Colour> colour = {};
  std::size_t dashes = 0;
};

/// Curves over common axes, with a legend and round numbers beside the grid, in a picture of 900 x 560
/// pixels. A title that says what the curves are of makes a `y_label` needless.
RgbPicture plot(const std::string& title, const std::string& x_label, const std::string& y_label,
                const std::vector<Curve>& curves);

}  // namespace xraycast
