#pragma once

#include "xraycast/volume/hu_histogram.hpp"
#include "xraycast/volume/scan_info.hpp"

#include <glm/vec3.hpp>

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace xraycast {

/// The position of a stored slice, in LPS millimetres.
struct SlicePlane {
  glm::dvec3 origin_mm;  ///< centre of its first voxel
  glm::dvec3 i_step_mm;  ///< from a voxel to its neighbour in the row, the one stored next
  glm::dvec3 j_step_mm;  ///< from a voxel to its neighbour in the column
};

/// A scan's slices as stored in its files, before conversion to the frame of VolumeGeometry: parallel planes
/// of `columns` x `rows` voxels. The readers make it, and deliver() takes it.
class SliceStack {
 public:
  virtual ~SliceStack() = default;

  /// Decodes slices `first` to `first + slices.size() - 1` on all cores, each to the address of its pointer,
  /// in HU clamped to [-1024, 32767]. Throws InputError when a file is damaged; and once all slices are
  /// decoded, when no voxel is a number, or more than 5 % of them and 1,000 are above 32767 HU.
  void decode(std::int64_t first, std::span<std::int16_t* const> slices);

  /// Of all slices decoded so far.
  SliceSource::HuRange hu_range() const;

  std::string name;  ///< the user's path, for messages
  std::int64_t columns = 0, rows = 0;
  std::vector<SlicePlane> planes;  ///< ascending along upward(normal)
  double thickness_mm =
      0;  ///< as the file states it, or 0: what a single slice and rounded positions rely on

 private:
  /// Prepares decoding; called on one thread.
  virtual void prepare() {}

  /// Decodes a slice into columns x rows values, and returns their range before clamping. Called on several
  /// threads at once. Throws as decode().
  virtual SliceSource::HuRange decode_slice(std::int64_t slice, std::span<std::int16_t> hu) const = 0;

  void sample(std::int64_t slice, const std::int16_t* hu);
  void check_values() const;

  std::int64_t decoded_ = 0;  ///< slices
  std::optional<SliceSource::HuRange> range_;
  HuHistogram histogram_;  ///< of a sample
};

/// The direction or its opposite: the one whose largest component is positive, so that slices sorted along it
/// run towards the patient's left, posterior or superior side.
glm::dvec3 upward(const glm::dvec3& direction);

/// The patient's side that a direction points to: L, R, P, A, S or I.
char side(const glm::dvec3& direction);

/// A note for values of 8 bits as they are.
inline constexpr const char* kEightBitNote =
    "8 bits a voxel hold grey values from 0 to 255 or so, no Hounsfield units; opacities and spectra expect "
    "HU";

/// Makes a SliceSource of a stack: without interpolation where flipping or transposing every slice suffices,
/// resampled otherwise. Completes `info`: size, spacing, tilt, gaps, notes and warnings.
Scan deliver(std::unique_ptr<SliceStack> stack, ScanInfo info, const ScanOptions& options);

}  // namespace xraycast
