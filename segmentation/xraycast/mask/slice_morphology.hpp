#pragma once

#include <cstdint>
#include <functional>
#include <span>

namespace xraycast {

/// A slice of a mask: `rows` rows of `columns` bytes, 1 inside and 0 outside.
struct MaskSlice {
  std::uint8_t* voxels;
  int columns, rows;
};

/// A structuring element; its anchor is its middle.
struct StructuringElement {
  enum class Shape { rectangle, ellipse };
  Shape shape;
  int columns, rows;
};

/// Two-dimensional morphology of masks. Calls for different slices may run at once.
class SliceMorphology {
 public:
  virtual ~SliceMorphology() = default;
  virtual void dilate(const MaskSlice& slice, const StructuringElement& element) const = 0;
  virtual void open(const MaskSlice& slice, const StructuringElement& element) const = 0;
  virtual void close(const MaskSlice& slice, const StructuringElement& element) const = 0;

  /// Calls `visit` with every hole, as the offsets of its voxels in the slice: a 4-connected component of the
  /// background that does not touch the slice's border. `visit` may change the slice.
  virtual void for_each_hole(const MaskSlice& slice,
                             const std::function<void(std::span<const int> offsets)>& visit) const = 0;
};

/// By OpenCV, which brings LAPACK and BLAS. It is loaded by the first call and not when the program starts.
/// Throws Error when it is not where the program was installed.
const SliceMorphology& slice_morphology();

}  // namespace xraycast
