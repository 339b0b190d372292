#pragma once

#include <glm/ext/vector_int3_sized.hpp>
#include <glm/vec3.hpp>

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>

namespace xraycast {

/// Number of voxels along x, y and z; 64 bits, so that products of them are safe once `voxel_count` accepted
/// them.
using Index3 = glm::i64vec3;

/// The grid of a volume's voxels. Every volume in xraycast is aligned with the patient: x grows towards the
/// patient's left, y towards posterior and z towards superior (LPS, millimetres). Readers reorient or
/// resample every file to this frame.
struct VolumeGeometry {
  Index3 size{0, 0, 0};
  glm::dvec3 spacing_mm{1, 1, 1};
  glm::dvec3 origin_mm{0, 0, 0};  ///< centre of voxel (0, 0, 0): the right-most, anterior, inferior one

  std::int64_t slice_voxels() const { return size.x * size.y; }
  std::int64_t voxel_count() const { return size.x * size.y * size.z; }

  /// Centre of a voxel, or any point between voxels.
  glm::dvec3 to_world_mm(const glm::dvec3& index) const { return origin_mm + spacing_mm * index; }
  glm::dvec3 to_index(const glm::dvec3& world_mm) const { return (world_mm - origin_mm) / spacing_mm; }

  /// Outer faces of the border voxels.
  glm::dvec3 lower_mm() const { return origin_mm - 0.5 * spacing_mm; }
  glm::dvec3 upper_mm() const { return lower_mm() + spacing_mm * glm::dvec3(size); }
  glm::dvec3 middle_mm() const { return 0.5 * (lower_mm() + upper_mm()); }

  bool operator==(const VolumeGeometry&) const = default;
};

/// Of a box, the lower x first, then y, then z.
std::array<glm::dvec3, 8> corners_of(const glm::dvec3& lower, const glm::dvec3& upper);

/// Throws InputError, with `name` in front, unless every size is 1 to 65,536 (so that the product fits in 48
/// bits), spacing and origin are finite, and spacing is positive.
void validate(const VolumeGeometry& geometry, const std::string& name);

/// The range of stored CT numbers. Lower values are padding or noise and count as air; readers clamp to both
/// ends.
inline constexpr std::int16_t kPaddingHu = -1024, kMaxHu = 32767;

/// A whole scan in memory: int16 Hounsfield units, x fastest, then y, then z. Move-only; the voxels are not
/// initialised.
class Volume {
 public:
  /// Throws InputError, with `name` in front, when the geometry is invalid or needs more than the machine's
  /// memory.
  explicit Volume(const VolumeGeometry& geometry, const std::string& name = "volume");

  /// Voxels that lie elsewhere, such as in another program's array, without a copy; the last thing that is
  /// done with them is `release`. Throws InputError, with `name` in front, when the geometry is invalid.
  using Release = std::function<void(std::int16_t*)>;
  Volume(const VolumeGeometry& geometry, std::int16_t* hu, Release release, const std::string& name);

  const VolumeGeometry& geometry() const { return geometry_; }

  std::span<std::int16_t> hu() { return {hu_.get(), static_cast<std::size_t>(geometry_.voxel_count())}; }
  std::span<const std::int16_t> hu() const {
    return {hu_.get(), static_cast<std::size_t>(geometry_.voxel_count())};
  }

  /// Slices `first` to `first + count - 1`.
  std::span<const std::int16_t> slices(std::int64_t first, std::int64_t count) const {
    return hu().subspan(static_cast<std::size_t>(first * geometry_.slice_voxels()),
                        static_cast<std::size_t>(count * geometry_.slice_voxels()));
  }

  std::int16_t& at(std::int64_t x, std::int64_t y, std::int64_t z) { return hu_[offset(x, y, z)]; }
  std::int16_t at(std::int64_t x, std::int64_t y, std::int64_t z) const { return hu_[offset(x, y, z)]; }

 private:
  std::size_t offset(std::int64_t x, std::int64_t y, std::int64_t z) const {
    return static_cast<std::size_t>((z * geometry_.size.y + y) * geometry_.size.x + x);
  }

  VolumeGeometry geometry_;
  std::unique_ptr<std::int16_t[], Release> hu_;
};

}  // namespace xraycast
