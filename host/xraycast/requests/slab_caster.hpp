#pragma once

#include "xraycast/casting/caster.hpp"
#include "xraycast/opencl/resident_scan.hpp"
#include "xraycast/volume/slice_source.hpp"

#include <cstdint>

namespace xraycast {

/// Maximum number of slices in a slab: enough for every core to have some to read, and few enough to stay in
/// a processor's cache.
inline constexpr std::int64_t kMaxSlabSlices = 64;

/// Number of slices per slab, a multiple of ResidentScan::kBrickSlices, so that it stays within `limit_B`
/// bytes: two slabs in the host's memory, of which one is read while the other is cast, and one on the
/// device. The map is not included. Throws InputError when even the smallest slab exceeds the limit.
std::int64_t slab_slices_within(const VolumeGeometry& volume, std::int64_t limit_B);

/// Bytes that a whole scan takes on the device.
std::int64_t resident_bytes(const VolumeGeometry& volume);

/// Shows all slices to `finder`, holding few of them at a time. Stage "looking" of `progress`.
void look_through(SliceSource& source, OutlineFinder& finder, Progress& progress);

/// Casts a cylinder map of a scan that need not fit in memory, slab by slab; reading the next slab overlaps
/// uploading and casting this one. Rays stay within their slices, so the map equals that of a whole cast, bit
/// for bit. Stage "casting" of `progress`. `timings` receives the time spent waiting for slices and uploading
/// them.
///
/// `source` must not have been read from yet. Throws InputError for other projections, whose rays cross
/// slices, and when the source ends early.
CastResult cast_by_slabs(ComputeDevice& device, SliceSource& source, const MapGeometry& geometry,
                         const Opacity& opacity, std::int64_t slab_slices, LoadTimings& timings,
                         Progress& progress);

}  // namespace xraycast
