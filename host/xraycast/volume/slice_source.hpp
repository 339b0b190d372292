#pragma once

#include "xraycast/base/progress.hpp"
#include "xraycast/volume/volume.hpp"

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace xraycast {

/// A scan that arrives slice by slice, from the most inferior to the most superior, so that a scan larger
/// than memory can be cast. Readers, resamplers and phantoms are SliceSources.
class SliceSource {
 public:
  virtual ~SliceSource() = default;

  /// Known before the first slice is read, and constant.
  virtual const VolumeGeometry& geometry() const = 0;

  /// Fills `hu` with as many of the next slices as fit, in Hounsfield units clamped to [-1024, 32767], and
  /// returns their number; 0 after the last one. Advances `progress` by one for each slice. Throws InputError
  /// when the file is damaged.
  virtual std::int64_t read(std::span<std::int16_t> hu, Progress& progress) = 0;

  /// Smallest and largest HU of the slices read so far, before clamping; {0, 0} before the first. And what of
  /// these slices' voxels the user should check.
  struct HuRange {
    double lowest = 0, highest = 0;
    std::int64_t not_numbers = 0;  ///< voxels of NaN or minus infinity, which count as air
    std::int64_t clamped = 0;      ///< voxels of 32767 HU, where `highest` is above that
    bool is_shifted = false;       ///< by their histogram the values are HU + 1024

    /// Whether no value is below water, as in a subtracted angiogram.
    bool is_subtracted() const { return lowest >= 0 && highest > lowest && !is_shifted; }

    /// One line each; the remedy is named as the field of ScanOptions.
    std::vector<std::string> warnings() const;
  };
  virtual HuRange hu_range() const = 0;
};

/// Reads all slices. Starts a stage "reading" of `progress`. Throws as Volume, with `name` in front.
Volume collect(SliceSource& source, Progress& progress, const std::string& name = "volume");

/// Yields the slices of a volume in memory; the volume must outlive it.
class VolumeSource final : public SliceSource {
 public:
  explicit VolumeSource(const Volume& volume) : volume_(volume) {}
  const VolumeGeometry& geometry() const override { return volume_.geometry(); }
  std::int64_t read(std::span<std::int16_t> hu, Progress& progress) override;
  HuRange hu_range() const override { return range_; }

 private:
  const Volume& volume_;
  std::int64_t next_ = 0;
  HuRange range_;
};

}  // namespace xraycast
