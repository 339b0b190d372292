#include "xraycast/casting/spectral_scan.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/stopwatch.hpp"
#include "xraycast/motion/moved_scan.hpp"
#include "xraycast/scan/scan.hpp"

#include <algorithm>

namespace xraycast {
namespace {

/// Calls `collect(scan, contents)` for each material with the scan that contains it, and returns the results.
/// Water ends in dense bone, where the ramps that a kernel sums cancel up to rounding; no mass is negative.
template <typename Collect>
MaterialDepths depths_of(const SpectralScan& scan, std::size_t rays, const Collect& collect) {
  const auto contents = material_contents();
  constexpr std::size_t kWater = 0, kBone = 1, kIodine = 2;
  MaterialDepths depths;
  for (const std::size_t m : {kWater, kBone}) depths[m] = collect(scan.native, contents[m]);
  depths[kIodine] = scan.contrast ? collect(*scan.contrast, contents[kIodine]) : std::vector<float>(rays);
  for (std::vector<float>& depth : depths)
    for (float& g_cm2 : depth) g_cm2 = std::max(g_cm2, 0.0f);
  return depths;
}

}  // namespace

SpectralScan load(ComputeDevice& device, SliceSource& scan, SliceSource& vessels, OutlineFinder& finder,
                  LoadTimings& timings, Progress& progress) {
  check_mask_grid(vessels.geometry(), scan.geometry(), "vessel mask");
  const Stopwatch reading;
  Volume native = collect(scan, progress);
  finder.add(native.hu());
  const Volume enhancement = take_contrast(native, collect(vessels, progress));
  timings.read_ms = reading.ms();
  const Stopwatch uploading;
  SpectralScan resident{upload(device, native), upload(device, enhancement)};
  timings.upload_ms = uploading.ms();
  return resident;
}

SpectralScan load(ComputeDevice& device, SliceSource& scan, const std::filesystem::path& iodine,
                  OutlineFinder& finder, LoadTimings& timings, Progress& progress, const HeldMotion& motion) {
  if (iodine.empty()) return {load(device, scan, finder, timings, progress), {}};
  Scan vessels = open_scan(iodine, {}, progress);
  check_mask_grid(vessels.source->geometry(), scan.geometry(), "`iodine` " + iodine.string());
  if (!motion.is_still()) {
    Volume mask = collect(*vessels.source, progress);
    // Between voxels the larger share decides, whatever the mask's values.
    for (std::int16_t& value : mask.hu()) value = value > 0 ? 1 : 0;
    vessels.source = moved_slices(std::make_shared<const Volume>(std::move(mask)), motion);
  }
  return load(device, scan, *vessels.source, finder, timings, progress);
}

void check_iodine(const std::filesystem::path& iodine, const Attenuation& attenuation) {
  if (!iodine.empty() && !std::holds_alternative<Spectrum>(attenuation))
    throw InputError("`iodine` {}: needs a spectrum; add `opacity` spectrum:KVP", iodine.string());
}

std::vector<std::string> opacity_hints(const Attenuation& attenuation, const SliceSource::HuRange& hu) {
  const auto* opacity = std::get_if<Opacity>(&attenuation);
  if (!opacity || *opacity != Opacity::paper() || !hu.is_subtracted()) return {};
  return {"no voxel is below 0 HU; if this is a subtracted CT angiogram, use `opacity` subtracted"};
}

CastResult cast(const SpectralScan& scan, const MapGeometry& geometry, const Spectrum& spectrum,
                Progress& progress, const MovedRows* moved) {
  CastResult result;
  result.map.geometry = geometry;
  result.map.attenuation = spectrum;
  const std::size_t texels = result.map.layer_size() * static_cast<std::size_t>(geometry.layers());
  result.map.depths = depths_of(scan, texels, [&](const ResidentScan& resident, const Opacity& contents) {
    CastResult part = cast(resident, geometry, contents, progress, moved);
    result.kernel_ms += part.kernel_ms;
    return std::move(part.map.tau);
  });
  return result;
}

CastResult cast(const SpectralScan& scan, const MapGeometry& geometry, const Attenuation& attenuation,
                Progress& progress, const MovedRows* moved) {
  const auto* spectrum = std::get_if<Spectrum>(&attenuation);
  return spectrum ? cast(scan, geometry, *spectrum, progress, moved)
                  : cast(scan.native, geometry, std::get<Opacity>(attenuation), progress, moved);
}

ProjectedMasses project_masses(const SpectralScan& scan, const View& view, Progress& progress) {
  ProjectedMasses masses;
  const std::size_t pixels = static_cast<std::size_t>(view.width) * static_cast<std::size_t>(view.height);
  masses.g_cm2 = depths_of(scan, pixels, [&](const ResidentScan& resident, const Opacity& contents) {
    ProjectionImage part = project(resident, view, contents, progress);
    masses.kernel_ms += part.kernel_ms;
    return std::move(part.tau);
  });
  return masses;
}

ProjectionImage project(const SpectralScan& scan, const View& view, const Spectrum& spectrum,
                        Progress& progress) {
  const ProjectedMasses masses = project_masses(scan, view, progress);
  return {view, SpectrumModel(spectrum).tau(masses.g_cm2), masses.kernel_ms};
}

}  // namespace xraycast
