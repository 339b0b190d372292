#include "xraycast/requests/slab_caster.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/stopwatch.hpp"

#include <algorithm>
#include <future>
#include <memory>

namespace xraycast {
namespace {

/// Reads the remaining slices, up to the slab's size.
struct Slab {
  std::unique_ptr<std::int16_t[]> hu;
  std::int64_t slices = 0;
};

void fill(Slab& slab, SliceSource& source, std::int64_t wanted, Progress& progress) {
  const std::int64_t slice = source.geometry().slice_voxels();
  for (slab.slices = 0; slab.slices < wanted;) {
    const std::int64_t count = source.read(
        {slab.hu.get() + slab.slices * slice, static_cast<std::size_t>((wanted - slab.slices) * slice)},
        progress);
    if (count == 0)
      throw InputError("the scan ended before the last of its {} slices; copy it again",
                       source.geometry().size.z);
    slab.slices += count;
  }
}

/// The part of a map made from slices `first` to `first + count - 1`; superior rows come first.
MapGeometry rows_of(const MapGeometry& whole, std::int64_t first, std::int64_t count) {
  MapGeometry part = whole;
  const std::int64_t top_row = whole.height - first - count;
  part.height = static_cast<int>(count);
  part.top_mm = whole.z_mm(static_cast<double>(top_row));
  if (whole.centre_mm.size() > 1)
    part.centre_mm.assign(whole.centre_mm.begin() + top_row, whole.centre_mm.begin() + top_row + count);
  if (!whole.has_plane_outline())
    part.outline_mm.assign(whole.outline_mm.begin() + top_row * whole.width,
                           whole.outline_mm.begin() + (top_row + count) * whole.width);
  return part;
}

void insert_rows(const BodyMap& part, std::int64_t top_row, BodyMap& whole) {
  for (int k = 0; k < whole.geometry.layers(); ++k)
    std::ranges::copy(part.layer(k),
                      whole.tau.begin() +
                          static_cast<std::ptrdiff_t>(static_cast<std::size_t>(k) * whole.layer_size()) +
                          top_row * whole.geometry.width);
}

}  // namespace

std::int64_t resident_bytes(const VolumeGeometry& volume) {
  const std::int64_t bricks = (volume.size.z + ResidentScan::kBrickSlices - 1) / ResidentScan::kBrickSlices;
  return (volume.size.x + 1) * (volume.size.y + 1) * bricks * ResidentScan::kBrickSlices *
         static_cast<std::int64_t>(sizeof(std::int16_t));
}

std::int64_t slab_slices_within(const VolumeGeometry& volume, std::int64_t limit_B) {
  VolumeGeometry smallest = volume;
  smallest.size.z = ResidentScan::kBrickSlices;
  const std::int64_t slab_B = 3 * resident_bytes(smallest), slabs = limit_B / slab_B;
  if (slabs < 1)
    throw InputError("a memory limit of {} MiB is below the {} MiB that {} slices of {} x {} take; raise it",
                     limit_B >> 20, (slab_B >> 20) + 1, ResidentScan::kBrickSlices, volume.size.x,
                     volume.size.y);
  return std::min(slabs * ResidentScan::kBrickSlices, kMaxSlabSlices);
}

void look_through(SliceSource& source, OutlineFinder& finder, Progress& progress) {
  const VolumeGeometry& volume = source.geometry();
  const std::int64_t most = std::min<std::int64_t>(64, volume.size.z);
  Slab slab{
      std::make_unique_for_overwrite<std::int16_t[]>(static_cast<std::size_t>(most * volume.slice_voxels())),
      0};
  progress.begin("looking", volume.size.z, "slices");
  for (std::int64_t first = 0; first < volume.size.z; first += slab.slices) {
    fill(slab, source, std::min(most, volume.size.z - first), progress);
    finder.add({slab.hu.get(), static_cast<std::size_t>(slab.slices * volume.slice_voxels())});
  }
}

CastResult cast_by_slabs(ComputeDevice& device, SliceSource& source, const MapGeometry& geometry,
                         const Opacity& opacity, std::int64_t slab_slices, LoadTimings& timings,
                         Progress& progress) {
  const VolumeGeometry& volume = source.geometry();
  if (geometry.ray_layout != RayLayout::cylinder)
    throw InputError(
        "a {} map needs the whole scan at once, since its rays cross slices; raise the memory limit",
        to_string(geometry.ray_layout));
  CastResult result{{geometry, opacity, {}, {}}};
  result.map.tau.resize(static_cast<std::size_t>(geometry.layers()) * result.map.layer_size());

  const auto slab_voxels =
      static_cast<std::size_t>(std::min(slab_slices, volume.size.z) * volume.slice_voxels());
  Slab now{std::make_unique_for_overwrite<std::int16_t[]>(slab_voxels), 0};
  Slab next{std::make_unique_for_overwrite<std::int16_t[]>(slab_voxels), 0};
  const auto size_at = [&](std::int64_t first) { return std::min(slab_slices, volume.size.z - first); };

  VolumeGeometry part = volume;
  part.size.z = size_at(0);
  // Reallocating it for every slab would take longer than the work on it.
  ResidentScan scan(device, part);

  progress.begin("casting", volume.size.z, "slices");
  const Stopwatch reading_first;
  fill(now, source, size_at(0), progress);
  timings.read_ms += reading_first.ms();
  std::int64_t first = 0;
  while (first < volume.size.z) {
    const std::int64_t behind = first + now.slices;
    std::future<void> reading;
    if (behind < volume.size.z)
      reading = std::async(std::launch::async, [&] { fill(next, source, size_at(behind), progress); });

    part.size.z = now.slices;
    part.origin_mm.z = volume.origin_mm.z + static_cast<double>(first) * volume.spacing_mm.z;
    const Stopwatch uploading;
    scan.restart(part);
    scan.append({now.hu.get(), static_cast<std::size_t>(now.slices * volume.slice_voxels())});
    timings.upload_ms += uploading.ms();
    Progress part_progress;  // the slices are counted as they are read
    const CastResult rows = cast(scan, rows_of(geometry, first, now.slices), opacity, part_progress);
    insert_rows(rows.map, geometry.height - behind, result.map);
    result.kernel_ms += rows.kernel_ms;

    const Stopwatch waiting;
    if (reading.valid()) reading.get();
    timings.read_ms += waiting.ms();
    std::swap(now, next);
    first = behind;
  }
  return result;
}

}  // namespace xraycast
