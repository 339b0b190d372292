#pragma once

#include "xraycast/casting/basis.hpp"
#include "xraycast/casting/body_map.hpp"

#include <vector>

namespace xraycast {

/// A basis on the device, and the map that it makes under the opacity of the moment. Equal to casting the
/// scan anew but for the rounding of the weights (see Basis). Move-only.
class RecastSession {
 public:
  /// Copies the weights to the device, which has to outlive the session. The opacity is 0 everywhere. Throws
  /// DeviceError when the device has not enough memory.
  RecastSession(ComputeDevice& device, const Basis& basis);
  RecastSession(RecastSession&&) = default;  // tau_ is the memory of map_.tau, which moves with it
  RecastSession& operator=(RecastSession&&) = default;

  /// The map under `opacity`, whose knots have to be among those of the basis: any function that is linear
  /// between them and constant beyond its own ends. Throws InputError that names a knot which is not.
  const BodyMap& recast(const Opacity& opacity);

  /// Moves mu at one knot of the basis, touching only what this knot weighs. The map's opacity then has all
  /// knots of the basis. Throws InputError when there is no such knot, or mu is not finite or negative.
  const BodyMap& set_knot(std::size_t knot, double mu_per_mm);

  /// Makes the basis anew on other knots, from the scan it was made from. The opacity is 0 again.
  void reknot(const ResidentScan& scan, std::vector<double> knots_hu, Progress& progress);

  std::span<const double> knots_hu() const { return knots_hu_; }
  const BodyMap& map() const { return map_; }
  double kernel_ms() const { return kernel_ms_; }  ///< of the last recast() or set_knot()

 private:
  /// Runs a kernel of recast.cl over all tiles and fetches tau. The kernel's own arguments are set.
  void run(cl::Kernel& kernel);
  void recast_all();

  ComputeDevice* device_;
  std::vector<double> knots_hu_;
  std::vector<float> mu_per_mm_;  ///< at the knots
  BodyMap map_;
  cl::Buffer touched_, first_row_, weights_, unit_mm_;
  cl::Buffer tau_;      ///< the memory of map_.tau
  int moves_left_ = 0;  ///< of single knots, before tau is summed up anew
  double kernel_ms_ = 0;
};

}  // namespace xraycast
