#pragma once

#include "xraycast/base/picture_file.hpp"
#include "xraycast/simulation/run.hpp"

#include <cstddef>
#include <string>
#include <vector>

namespace xraycast {

/// Samples a run's records at the resolution of a plot.
class HubSamples {
 public:
  explicit HubSamples(const Script& script);

  /// Tell it of a run (see RunListener).
  void record(const Instruments& instruments, double time_s);

  const std::vector<std::vector<RunRecord>>& records() const { return records_; }  ///< as those of a Run

 private:
  double interval_s_;
  std::vector<std::vector<RunRecord>> records_;
};

/// The force and the torque at the hub of an instrument over a run, whose records are given.
RgbPicture hub_plot(const std::string& title, const std::vector<std::vector<RunRecord>>& records,
                    std::size_t instrument);

}  // namespace xraycast
