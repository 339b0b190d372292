#pragma once

#include "xraycast/attenuation/spectrum.hpp"
#include "xraycast/casting/caster.hpp"
#include "xraycast/motion/motion.hpp"
#include "xraycast/opencl/resident_scan.hpp"
#include "xraycast/projection/projector.hpp"

#include <filesystem>
#include <optional>
#include <string>

namespace xraycast {

/// A scan in a device's memory, with the contrast agent separate when its vessels are known: CT numbers alone
/// cannot tell iodine from bone.
struct SpectralScan {
  ResidentScan native;                   ///< the scan; without the enhancement if that is separate
  std::optional<ResidentScan> contrast;  ///< the enhancement in HU
};

/// Reads a scan and its vessel mask, both held in the host's memory meanwhile (see take_contrast). `finder`
/// sees every slice. Stage "reading" of `progress`, twice. Throws InputError when the mask lies on another
/// grid.
SpectralScan load(ComputeDevice& device, SliceSource& scan, SliceSource& vessels, OutlineFinder& finder,
                  LoadTimings& timings, Progress& progress);

/// The same of a mask in a file, or of none where `iodine` is empty: the scan is then not held in the host's
/// memory. Where the scan was moved, the mask is moved alike.
SpectralScan load(ComputeDevice& device, SliceSource& scan, const std::filesystem::path& iodine,
                  OutlineFinder& finder, LoadTimings& timings, Progress& progress,
                  const HeldMotion& motion = {});

/// Throws InputError where a mask of iodine goes with an opacity.
void check_iodine(const std::filesystem::path& iodine, const Attenuation& attenuation);

/// Suggests the opacity `subtracted` for a scan that has no voxel below water; empty otherwise.
std::vector<std::string> opacity_hints(const Attenuation& attenuation, const SliceSource::HuRange& hu);

/// A spectrum map: the masses of kMaterials along the rays of `geometry`. Otherwise as `cast` of an opacity,
/// with a stage "casting" for each material.
CastResult cast(const SpectralScan& scan, const MapGeometry& geometry, const Spectrum& spectrum,
                Progress& progress, const MovedRows* moved = nullptr);

/// By either.
CastResult cast(const SpectralScan& scan, const MapGeometry& geometry, const Attenuation& attenuation,
                Progress& progress, const MovedRows* moved = nullptr);

/// H x W masses of kMaterials in g/cm2 along a view's rays, row 0 on top.
struct ProjectedMasses {
  MaterialDepths g_cm2;
  double kernel_ms = 0;
};
ProjectedMasses project_masses(const SpectralScan& scan, const View& view, Progress& progress);

/// The DRR with a spectrum: the masses of kMaterials are summed along each ray, and the optical depth follows
/// from their total. Otherwise as `project` of an opacity, with a stage "projecting" for each material.
ProjectionImage project(const SpectralScan& scan, const View& view, const Spectrum& spectrum,
                        Progress& progress);

}  // namespace xraycast
