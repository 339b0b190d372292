#include "attenuation.hpp"

#include "xraycast/base/error.hpp"

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

std::variant<Opacity, Spectrum> resolve(const AttenuationOptions& options) {
  const std::string prefix = "spectrum:";
  if (options.opacity.starts_with(prefix)) return Spectrum::named(options.opacity.substr(prefix.size()));
  if (!options.iodine.empty())
    throw InputError("--iodine {}: needs a spectrum; add --opacity spectrum:KVP", options.iodine);
  return Opacity::named(options.opacity);
}

void say_about_values(const std::variant<Opacity, Spectrum>& attenuation, const SliceSource& voxels,
                      const Session& session) {
  session.say_about(voxels);
  const auto* opacity = std::get_if<Opacity>(&attenuation);
  if (opacity && *opacity == Opacity::paper() && voxels.hu_range().is_subtracted())
    session.say({"no voxel is below 0 HU; if this is a subtracted CT angiogram, use --opacity subtracted"});
}

SpectralScan load(ComputeDevice& device, const Scan& scan, const AttenuationOptions& options,
                  OutlineFinder& finder, LoadTimings& timings, Progress& progress) {
  if (options.iodine.empty()) return {load(device, *scan.source, finder, timings, progress), {}};
  const Scan vessels = open_scan(options.iodine, {}, progress);
  check_mask_grid(vessels.source->geometry(), scan.source->geometry(), "--iodine " + options.iodine);
  return load(device, *scan.source, *vessels.source, finder, timings, progress);
}

}  // namespace xraycast::cli
