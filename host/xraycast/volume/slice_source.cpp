#include "xraycast/volume/slice_source.hpp"

#include "xraycast/base/pluralize.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace xraycast {

std::vector<std::string> SliceSource::HuRange::warnings() const {
  std::vector<std::string> lines;
  if (not_numbers == 1)
    lines.emplace_back("1 voxel is not a number and counts as air");
  else if (not_numbers > 1)
    lines.push_back(fmt::format("{} voxels are not numbers and count as air", not_numbers));
  if (clamped > 0)
    lines.push_back(fmt::format("{} reached {} HU, with values up to {:g}; all of them count as {}",
                                pluralize(clamped, "voxel"), kMaxHu, highest, kMaxHu));
  if (is_shifted)
    lines.emplace_back(
        "no value is below 0 and soft tissue lies about 1024, so the values seem to be HU + 1024; if they "
        "are, give `offset_hu` -1024");
  return lines;
}

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
