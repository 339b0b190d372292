#pragma once

#include "xraycast/attenuation/opacity.hpp"
#include "xraycast/base/progress.hpp"
#include "xraycast/casting/device_field.hpp"
#include "xraycast/casting/key_maps.hpp"
#include "xraycast/casting/map_geometry.hpp"
#include "xraycast/opencl/resident_scan.hpp"

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace xraycast {

/// What the key maps of a moving body are made of, except for the first one.
struct BasisKeys {
  KeyPhases phases;
  std::filesystem::path motion;  ///< as of KeyMaps

  struct Key {
    KeyRows rows;
    std::vector<std::uint64_t> touched;  ///< of all tiles; of those beyond the own rows nothing
    std::vector<std::uint16_t> weights;
  };
  std::vector<Key> others;
};

/// The part of a scan from which a body map can be made again with any opacity on given knots: tau is linear
/// in the opacity's values at its knots, so for every texel and layer the length of every sample is stored,
/// split between the two knots around its HU (beyond the end knots: all to the end knot). An optical depth is
/// then the sum of mu(knot) * weight, without the scan.
///
/// Stored sparsely, since a shell's samples in neighbouring slices lie between few knots. A tile is one
/// column of one layer in 16 slices, counted from the most inferior one; tile (brick * layers + layer) *
/// width + column has, for every knot that any of its texels touches, a row of 16 weights, one per slice.
/// Slices beyond the last have weight 0.
///
/// Weights are whole multiples of the shell's thickness / 65535 and those of a texel add up to the thickness.
/// The running sum over the knots is rounded, by at most half a unit; hence the error of tau is at most
/// thickness / 131070 * (sum over neighbouring knots of |mu's difference|).
struct Basis {
  static constexpr std::int64_t kTileSlices = ResidentScan::kBrickSlices;
  static constexpr int kHistogramBin_hu = XRC_HISTOGRAM_BIN_HU;
  static constexpr int kHistogramStride = 4;

  MapGeometry geometry;
  std::vector<double> knots_hu;  ///< 1 to 64, strictly ascending
  std::string source;            ///< description of the scan
  /// Histogram of every fourth row and column of the scan, in bins of 16 HU from -1024 HU on; the last of 256
  /// bins holds all above. For drawing below an opacity's curve.
  std::vector<std::int64_t> hu_histogram;
  std::vector<std::uint64_t> touched;    ///< of each tile: bit k says whether knot k has a row
  std::vector<std::uint16_t> weights;    ///< the rows, tile by tile, in the order of the knots
  std::string frame_of_reference_uid{};  ///< as a BodyMap's

  /// Of a body that moves: what the key maps after the first one are made of. What is above is the first
  /// one's.
  std::shared_ptr<const BasisKeys> keys{};

  double unit_mm(int layer) const;
};

/// Number of tiles of a basis of this geometry.
std::int64_t tile_count(const MapGeometry& geometry);

/// Throws InputError, with `name` in front, unless there are 1 to 64 knots that ascend within [-1024, 32767]
/// and differ as 32-bit floats.
void validate_knots(std::span<const double> knots_hu, const std::string& name);

/// The knots of an opacity, plus 31 default ones between air and metal if both fit into 64, so that a basis
/// cast with `paper` supports more than straight lines.
std::vector<double> useful_knots_hu(const Opacity& opacity);

/// Sums the weights of the samples that cast() takes: recasting equals casting again except for rounding.
/// Stage "weighing" of `progress`. `source` is left to the caller. With `moved` the rays pass through the
/// scan while it is displaced, and only the tiles of these rows have weights. Errors as for cast() and
/// validate_knots().
Basis make_basis(const ResidentScan& scan, const MapGeometry& geometry, std::vector<double> knots_hu,
                 Progress& progress, const MovedRows* moved = nullptr);

}  // namespace xraycast
