#pragma once

#include "xraycast/device.hpp"
#include "xraycast/mask.hpp"
#include "xraycast/volume.hpp"

#include <vector>

namespace xraycast {

/// Whether a scan's whole range is ten standard deviations of its noise or less, so that its vessels lie
/// within the noise's reach (four above the background, four below the lumen) and only averaging along them
/// parts them from it.
bool is_buried_in_noise(const Volume& volume);

/// The median of values, and the standard deviation that their median absolute deviation stands for.
struct Spread {
  double median, standard_deviation;
};
Spread spread_of(const std::vector<float>& values);

/// How bright each voxel is, smoothed by a Gaussian of `across_vox` voxels, less what lies around it,
/// smoothed by one of three; in the scan's unit. Throws DeviceError.
std::vector<float> local_contrast(const Volume& volume, double across_vox, Device& device);

/// How strong the strongest straight line through each voxel is, in the scan's unit: what is bright across it
/// within a voxel, less what is bright for three voxels around, averaged along seven voxels to both sides of
/// which the weaker counts; over 64 directions. Where a bright thing lies on one side only there is no line,
/// so that vessels have no halo and end where they end.
std::vector<float> line_strength(const Volume& volume, Device& device);

/// Thin vessels by their line strength on this grid, in standard deviations above the background: strong is
/// what has 4.25, in lumps of five voxels or more; weak stretches of 3 count where they join two strong
/// lumps, but not as dead ends; and the rim of both goes down to 2.5. A part without a strong lump of 14
/// voxels, the length of the filter's line, is dropped: in noise alone the largest has nine.
Mask find_line_vessels(const std::vector<float>& strength, const VolumeGeometry& grid);

}  // namespace xraycast
