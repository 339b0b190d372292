#pragma once

#include "xraycast/volume/volume.hpp"

#include <filesystem>
#include <vector>

/// Baselines of the benchmarks. Nothing here uses xraycast's kernels.
namespace xraycast::bench {

/// A part of a scan, x fastest.
struct Cube {
  VolumeGeometry grid;
  std::vector<float> hu;
};

/// All cores read the bytes once.
void read_all(const Volume& volume);

/// All cores take `samples` bilinear samples in 16 slices each, from a block that stays in the first-level
/// cache, and classify them by the paper's opacity.
void sample_from_cache(std::int64_t samples);

/// One thread reads a file into fresh memory by read().
void read_file(const std::filesystem::path& path);

/// One map of 360 angles by OpenCV on all cores: warpPolar and reduce, slice by slice.
void map_by_opencv(const Volume& volume, double radius_vox);

/// Frangi's vesselness by ITK at several scales: its recursive Gaussians, and its objectness measure.
void vesselness_by_itk(const Cube& cube, const std::vector<double>& scales_mm);

/// A DICOM folder by ITK's series reader alone.
void read_series_by_itk(const std::filesystem::path& folder);

}  // namespace xraycast::bench
