#pragma once

#include "xraycast/mask/mask.hpp"
#include "xraycast/opencl/compute_device.hpp"
#include "xraycast/scan/volume.hpp"

#include <vector>

namespace xraycast {

/// Whether a scan's whole range is ten standard deviations of its noise or less, so that its vessels lie
/// within the noise's reach (four above the background, four below the lumen) and only averaging along them
/// parts them from it.
bool is_buried_in_noise(const Volume& volume);

/// How strong the strongest straight line through each voxel is, in the scan's unit: what is bright across it
/// within a voxel, less what is bright for three voxels around, averaged along seven voxels to both sides of
/// which the weaker counts; over 64 directions. Where a bright thing lies on one side only there is no line,
/// so that vessels have no halo and end where they end.
std::vector<float> line_strength(const Volume& volume, ComputeDevice& device);

/// Thin vessels by their line strength on this grid, in standard deviations above the background: strong is
/// what has 4.25, in lumps of five voxels or more; weak stretches of 3 count where they join two strong
/// lumps, but not as dead ends. A part without a strong lump of 14 voxels, the length of the filter's line,
/// is dropped: in noise alone the largest has nine.
Mask find_line_vessels(const std::vector<float>& strength, const VolumeGeometry& grid);

/// How far each voxel, smoothed by a Gaussian of `across_vox` voxels, rises above what lies around it,
/// smoothed by one of three, in standard deviations of the background. Throws DeviceError.
std::vector<float> local_rise(const Volume& volume, double across_vox, ComputeDevice& device);

/// The lumen of vessels whose lines are known: their middle, and of their voxels and those that share a face
/// or an edge with one what rises (local_rise, of 0.8 voxels) 13.3 % as far as the brightest or more. At that
/// limit a lumen one voxel wide, which rises a quarter as far as one of five voxels, has half its
/// height. The limit does not depend on the noise, so that vessels are neither wider nor thinner in more of
/// it: in a noise of 50 to 75 the volume of grown trees is right to three parts in a hundred. Dead ends that
/// rise less than 2.5 standard deviations in their mean are dropped, with what lies nearer to them than to
/// the rest: in noise of 75 the last of these follow as much vessel as noise.
Mask with_lumen(const Mask& lines, const std::vector<float>& rise);

}  // namespace xraycast
