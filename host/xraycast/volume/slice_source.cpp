#include "xraycast/volume/slice_source.hpp"

#include <algorithm>

namespace xraycast {

Volume collect(SliceSource& source, Progress& progress, const std::string& name) {
  Volume volume(source.geometry(), name);
  const std::int64_t slices = source.geometry().size.z;
  progress.begin("reading", slices, "slices");
  std::int64_t done = 0;
  while (done < slices) {
    const auto rest = volume.hu().subspan(static_cast<std::size_t>(done * source.geometry().slice_voxels()));
    const std::int64_t count = source.read(rest, progress);
    if (count == 0) break;
    done += count;
  }
  std::ranges::fill(volume.hu().subspan(static_cast<std::size_t>(done * source.geometry().slice_voxels())),
                    kPaddingHu);
  return volume;
}

std::int64_t VolumeSource::read(std::span<std::int16_t> hu, Progress& progress) {
  const std::int64_t slice = geometry().slice_voxels();
  const std::int64_t count =
      std::min(static_cast<std::int64_t>(hu.size()) / slice, geometry().size.z - next_);
  if (count <= 0) return 0;
  const auto slices = volume_.slices(next_, count);
  std::ranges::copy(slices, hu.begin());
  const auto [low, high] = std::ranges::minmax_element(slices);
  if (next_ == 0) range_ = {static_cast<double>(*low), static_cast<double>(*high)};
  range_ = {std::min<double>(range_.lowest, *low), std::max<double>(range_.highest, *high)};
  next_ += count;
  progress.advance(count);
  return count;
}

}  // namespace xraycast
