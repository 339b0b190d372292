#pragma once

#include "xraycast/casting/basis.hpp"
#include "xraycast/casting/body_map.hpp"

#include <vector>

namespace xraycast {

/// A basis on the device, and its map with the latest opacity. Equal to casting the scan again except for the
/// rounding of the weights (see Basis). Of a body that moves all key maps are made, of which the device holds
/// one basis after the other. Move-only.
class RecastSession {
 public:
  /// Copies the weights to the device, which must outlive the session. Throws DeviceError
  /// when the device has not enough memory.
  RecastSession(ComputeDevice& device, const Basis& basis);
  RecastSession(RecastSession&&) = default;  // tau_ is the memory of map_.tau, which moves with it
  RecastSession& operator=(RecastSession&&) = default;

  /// The map with `opacity`, whose knots must be among those of the basis: any function that is linear
  /// between them and constant beyond its own ends. Valid until the next call. Throws InputError, naming a
  /// knot that is not.
  const BodyMap& recast(const Opacity& opacity);

  double kernel_ms() const { return kernel_ms_; }  ///< of the last recast()

 private:
  /// What a map's tiles hold, on the device.
  struct Tiles {
    Tiles(ComputeDevice& device, std::span<const std::uint64_t> touched,
          std::span<const std::uint16_t> weights);
    cl::Buffer touched, first_row, weights;
  };

  void recast_tiles(const Tiles& tiles, const cl::Buffer& mu);
  void recast_keys(const cl::Buffer& mu);

  ComputeDevice* device_;
  std::vector<double> knots_hu_;
  BodyMap map_;
  Tiles tiles_;
  std::shared_ptr<const BasisKeys> keys_;
  cl::Buffer unit_mm_, scales_;
  cl::Buffer tau_;  ///< the memory of map_.tau
  double kernel_ms_ = 0;
};

}  // namespace xraycast
