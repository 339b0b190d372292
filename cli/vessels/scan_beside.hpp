#pragma once

#include "options/command.hpp"
#include "xraycast/volume/volume.hpp"

#include <optional>
#include <string>

namespace xraycast::cli {

/// A scan that is given beside vessels, whole; no volume where none is given.
struct ScanBeside {
  std::optional<Volume> volume;
  ScanInfo info;

  const Volume* voxels() const { return volume ? &*volume : nullptr; }
};

/// Of a path that may be empty. Throws as open_scan.
ScanBeside read_scan_beside(const std::string& path, const ScanOptions& options, Invocation& invocation);

}  // namespace xraycast::cli
