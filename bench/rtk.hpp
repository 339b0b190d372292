#pragma once

#include "xraycast/projection/view.hpp"

#include <filesystem>
#include <string>
#include <sys/types.h>
#include <vector>

namespace xraycast::bench {

/// RTK's projector of a scan with the paper's opacity, in a separate Python process (rtk_project.py).
class RtkProjector {
 public:
  /// `python` is an interpreter that finds the package itk-rtk. Reads the scan. Throws std::runtime_error
  /// with the reason when RTK is not available.
  RtkProjector(const std::filesystem::path& python, const std::filesystem::path& scan);
  ~RtkProjector();
  RtkProjector(const RtkProjector&) = delete;
  RtkProjector& operator=(const RtkProjector&) = delete;

  struct Picture {
    double ms;               ///< of the filter alone, on all cores
    std::vector<float> tau;  ///< H x W
  };

  /// `view` is complete and has a cone. Throws std::runtime_error when the process has ended.
  Picture project(const View& view);

 private:
  std::string line();
  void read(void* to, std::size_t bytes);

  pid_t process_ = -1;
  int socket_ = -1;  ///< the process's input and output
};

/// Peak signal-to-noise ratio of one picture against another, whose maximum is the peak.
double psnr_db(const std::vector<float>& picture, const std::vector<float>& truth);

}  // namespace xraycast::bench
