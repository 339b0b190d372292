#pragma once

#include "xraycast/base/progress.hpp"
#include "xraycast/evidence/lumen_fill.hpp"
#include "xraycast/evidence/lumen_scale.hpp"
#include "xraycast/opencl/compute_device.hpp"

namespace xraycast {

/// The vessels of a scan that shows nothing else bright: their mask, and how full of lumen its voxels are.
struct VesselEvidence {
  Mask vessels;
  LumenFill fill;
  LumenScale scale;
};

/// Finds vessels by one measure in all noise: the fraction of lumen in a voxel. The scan's blur and the
/// lumen's contrast are measured on the vessels themselves (lumen_scale). Ridges that rise above the noise
/// and above kLeastRidge of the lumen's contrast, and what is half full, are candidates. In sharp and quiet
/// scans, and in those whose voxels are mostly full or empty, voxels beside a candidate are in the mask when
/// by their own values (voxel_shares) they probably hold lumen. Else the scan, smoothed the more the more
/// noise there is, is deblurred within 3.5 voxels of candidates (Richardson 1972, Lucy 1974); voxels beside
/// one are in the mask when their fraction exceeds `least_fraction`, in vessels whose radius exceeds four
/// voxels when it exceeds one half. `noise_hu` is the noise's standard deviation; where the background varies
/// less than that, what the background shows counts. Two stages of `progress`. Throws InputError where a
/// block has too many voxels, Error without memory, DeviceError.
VesselEvidence vessel_evidence(const Volume& volume, double noise_hu, ComputeDevice& device,
                               Progress& progress);

/// By how much a scan is smoothed before its voxels' fractions are estimated, in voxels.
double smoothing_vox(const LumenScale& scale);

/// The fraction of lumen that a voxel of a thin vessel must exceed. In a sharp and quiet scan one that is
/// touched by a fourteenth exceeds it; smoothing and blur, which deblurring undoes in part, raise it. Chosen
/// so that in grown trees as many voxels are wrong as are missing.
double least_fraction(const LumenScale& scale);

/// The fraction that noise does not reach in a spur that has little contrast.
double certain_fraction(const LumenScale& scale);

}  // namespace xraycast
