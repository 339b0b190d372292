#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace xraycast {

/// How ITK's transforms lie in a file. Of fixed size, for memory that processes share.
struct Hdf5Layout {
  static constexpr std::size_t kMostType_B = 112, kMostTransforms = 1000;
  char type[kMostType_B];  ///< ends with a zero
  std::int64_t parameters, fixed_parameters;
};

/// What the module of HDF5 does, which may crash on damaged files. Failures are std::exceptions.
class Hdf5Transforms {
 public:
  virtual ~Hdf5Transforms() = default;

  /// All transforms of a file, in order.
  virtual std::vector<Hdf5Layout> layouts(const std::string& path) const = 0;

  /// Their numbers, of which there must be as many as `layouts` says: the parameters and then the fixed
  /// parameters of each.
  virtual void read(const std::string& path, std::span<double> numbers) const = 0;
};

}  // namespace xraycast
