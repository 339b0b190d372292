#pragma once

#include "xraycast/scene/canvas.hpp"

#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace xraycast::cli {

/// One line of a plot: its name, its points in the order they are joined, and its colour, where others than
/// the plot choose it.
struct Curve {
  std::string name;
  std::vector<std::pair<double, double>> points;
  std::optional<Colour> colour = {};
};

/// Draws curves over common axes, with a legend and round numbers beside the grid, into a picture of 900 x
/// 560 pixels. Throws InputError when `path` cannot be written, Error when the disk is full.
void write_plot(const std::string& title, const std::string& x_label, const std::string& y_label,
                const std::vector<Curve>& curves, const std::filesystem::path& path);

}  // namespace xraycast::cli
