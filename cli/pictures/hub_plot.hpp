#pragma once

#include "xraycast/simulation/run.hpp"

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

namespace xraycast::cli {

/// Samples the forces and torques at the hubs during a run, at the resolution of a plot, and draws them over
/// time, a PNG a device: forces.png, forces-2.png and so on.
class HubPlot {
 public:
  explicit HubPlot(const Script& script);

  /// Tell it of a run (see RunListener).
  void see(const Instruments& devices, double time_s);

  /// Errors as for write_plot.
  void write(const std::vector<InstrumentModel>& devices, const std::string& first) const;

  /// None where the first has no name.
  static std::vector<std::filesystem::path> paths(const std::string& first, std::size_t devices);

 private:
  double interval_s_;
  std::vector<std::vector<RunRecord>> records_;  ///< of each device
};

/// Draws the force and the torque at the hub over a run into a PNG. Errors as for write_plot.
void write_hub_plot(const std::string& title, const std::vector<RunRecord>& records,
                    const std::filesystem::path& path);

}  // namespace xraycast::cli
