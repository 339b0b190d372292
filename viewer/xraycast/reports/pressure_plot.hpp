#pragma once

#include "xraycast/base/picture_file.hpp"
#include "xraycast/simulation/run.hpp"

#include <string>
#include <vector>

namespace xraycast {

/// The blood's pressure in the aorta and at the tip of each instrument over a run, whose names are given.
RgbPicture pressure_plot(const Run& run, const std::vector<std::string>& names);

}  // namespace xraycast
