#include "attenuation_options.hpp"

namespace xraycast::cli {

void add_attenuation_options(CLI::App& command, AttenuationOptions& options) {
  command
      .add_option(
          "--opacity", options.opacity,
          "From HU to attenuation: paper, bilinear, subtracted (for subtracted CT angiograms), or a JSON "
          "file "
          "of HU and mu; spectrum: models beam hardening for 80, 100 or 120 kVp or a file of keV and fluence")
      ->capture_default_str()
      ->type_name("NAME|FILE|spectrum:KVP|spectrum:FILE");
  command
      .add_option("--iodine", options.iodine,
                  "With a spectrum: a mask of the vessels on the scan's grid; voxels in it that are brighter "
                  "than blood count as iodine, not bone")
      ->type_name("MASK");
}

}  // namespace xraycast::cli
