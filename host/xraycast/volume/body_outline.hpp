#pragma once

#include "xraycast/volume/volume.hpp"

#include <glm/vec2.hpp>

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

namespace xraycast {

/// The body's position in the scan: the default centre and radius of a map.
struct BodyOutline {
  glm::dvec2 centre_mm;     ///< x, y of the centroid of the trunk's voxels
  double radius_mm;         ///< of a circle about the centre that encloses the body in every slice
  double radius_99_mm = 0;  ///< of one that encloses 99 % of the body's voxels
  /// x and y of the trunk's axis for each mm of z, by the centroids of its slices; 0 where it is short.
  glm::dvec2 lean{0, 0};
  int limbs = 0;  ///< parts of the body apart from its trunk, such as arms beside it
  /// Right, left, anterior or posterior: where the scan ends within the body. None where it does so at all
  /// four, as a scan of a part of the body.
  std::vector<std::string> cut_sides{};
};

/// Above this the axis of a map should follow the body: 8 degrees.
inline constexpr double kMostLean = 0.14;

/// What an OutlineFinder looks for besides the circle around the body.
struct OutlineOptions {
  bool finds_skin = false;   ///< see OutlineFinder::visit_skin
  bool keeps_table = false;  ///< all voxels above the threshold count as body, except for the centre
};

/// Finds the body while the slices are read, on a grid of about 3 mm: everything above -300 HU, opened by
/// about 10 mm in each slice which removes the table's thin shells; the largest connected component is the
/// trunk, and others as thick and round as arms and legs are limbs. Both are the body.
///
/// Centre and radius are accurate to about one grid step; the radius errs on the large side.
class OutlineFinder {
 public:
  explicit OutlineFinder(const VolumeGeometry& geometry, OutlineOptions options = {});

  /// Slices in order, from slice 0 on; `hu` holds whole slices.
  void add(std::span<const std::int16_t> hu);

  /// After the last slice. Throws InputError when nothing lies above -300 HU.
  BodyOutline finish() const;

  /// Visits the middles (LPS mm) of the body's outermost voxels, on a grid of about a millimetre: those with
  /// a neighbour that is not above the threshold. The body is all that lies within one coarse cell of the
  /// body that finish() found. After the last slice; only for finders that look for the skin.
  void visit_skin(const std::function<void(const glm::dvec3&)>& visit) const;

  /// The same of the body's shadows along z, each of so many slices from slice 0 on: the outermost of their
  /// voxels and of those next to them, each once. `visit` also has the number of the shadow.
  void visit_shadow_skins(std::int64_t slices,
                          const std::function<void(int shadow, const glm::dvec3& voxel_mm)>& visit) const;

  /// The size of the voxels that are visited.
  glm::dvec3 skin_voxel_mm() const { return geometry_.spacing_mm * glm::dvec3(fine_stride_); }

 private:
  /// Those of the trunk, and then those of the limbs.
  struct BodyCells {
    std::vector<std::int64_t> all;
    std::size_t trunk = 0;  ///< how many of them
    int limbs = 0;
  };
  const BodyCells& body_cells() const;
  std::vector<std::string> cut_sides() const;
  glm::dvec2 lean_of_trunk() const;
  std::vector<std::uint8_t> cells_around_body() const;
  std::vector<std::vector<std::uint64_t>> shadows(std::int64_t slices) const;
  std::int64_t coarse(std::int64_t fine, int axis) const;
  void add_fine(std::span<const std::int16_t> slice);
  std::uint64_t fine_word(std::int64_t word, std::int64_t y, std::int64_t z) const;
  std::uint64_t skin_word(std::int64_t word, std::int64_t y, std::int64_t z) const;

  VolumeGeometry geometry_;
  OutlineOptions options_;
  Index3 stride_;  ///< in voxels
  Index3 size_;    ///< of the coarse grid
  std::int64_t slices_seen_ = 0;
  std::vector<std::uint8_t> dense_;  ///< 1 above the threshold; x fastest
  mutable BodyCells body_cells_;     ///< once they have been asked for

  Index3 fine_stride_, fine_size_;   ///< of the grid on which the skin is found
  std::int64_t fine_words_ = 0;      ///< of a row
  std::vector<std::uint64_t> fine_;  ///< a bit a voxel, 1 above the threshold; rows of whole words
};

}  // namespace xraycast
