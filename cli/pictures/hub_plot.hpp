#pragma once

#include "xraycast/simulation/run_script.hpp"

#include <filesystem>
#include <string>
#include <vector>

namespace xraycast::cli {

/// Draws the force and the torque at the hub over a run into a PNG. Errors as for write_plot.
void write_hub_plot(const std::string& title, const std::vector<RunRecord>& records,
                    const std::filesystem::path& path);

}  // namespace xraycast::cli
