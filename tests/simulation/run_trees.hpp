#pragma once

#include "xraycast/catheter/vessel_entry.hpp"
#include "xraycast/phantom/phantom.hpp"
#include "xraycast/scan/scan.hpp"
#include "xraycast/segmentation/centreline.hpp"
#include "xraycast/segmentation/threshold.hpp"
#include "xraycast/segmentation/vessel_selection.hpp"

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <numeric>
#include <optional>
#include <string>
#include <vector>

namespace xraycast {

namespace fs = std::filesystem;

inline VesselTree phantom_tree(const std::string& name) {
  return {make_phantom(name).vessel_branches(), name};
}

/// A tree from a scan in which vessels are what is brighter than `lowest`.
inline VesselTree scanned_tree(const fs::path& file, double lowest) {
  Progress progress;
  const Scan scan = open_scan(file, {}, progress);
  const Volume volume = collect(*scan.source, progress);
  Mask mask = between(volume, lowest, 32767);
  return extract_centrelines(select_vessels(mask, {}, file.string()), file.string()).tree;
}

inline VesselEnd widest_end(const VesselTree& tree) {
  const std::vector<VesselEnd> ends = vessel_ends(tree);
  return *std::ranges::max_element(ends, {}, &VesselEnd::radius_mm);
}

inline const char* const kTrees[] = {"thorax", "head", "tree_2", "tree_3", "avm"};

/// One of kTrees; none where it is of a scan that is not there.
inline std::optional<VesselTree> parse_tree(const std::string& name) {
  const fs::path data = XRAYCAST_TEST_DATA;
  if (name == "thorax" || name == "head") return phantom_tree(name);
  // The first are masks of 255, the second is an angiography.
  const fs::path file =
      name == "avm" ? data / "head-vessels" / "avm.nii.gz" : data / "vascusynth" / name / "original.mhd";
  if (!fs::exists(file)) return std::nullopt;
  return scanned_tree(file, name == "avm" ? 150 : 1);
}

/// The seeds of a tree's runs: XRAYCAST_RUNS of them over all trees, or `otherwise`, from XRAYCAST_FIRST_RUN
/// on, or 0.
inline std::vector<unsigned> seeds_a_tree(int otherwise) {
  const auto number = [](const char* name, int default_value) {
    const char* wanted = std::getenv(name);
    return wanted ? std::atoi(wanted) : default_value;
  };
  std::vector<unsigned> seeds(static_cast<std::size_t>(std::max(1, number("XRAYCAST_RUNS", otherwise) / 5)));
  std::iota(seeds.begin(), seeds.end(), static_cast<unsigned>(std::max(0, number("XRAYCAST_FIRST_RUN", 0))));
  return seeds;
}

}  // namespace xraycast
