#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

namespace xraycast {

/// Searches the maximum of a function that may have many, without derivatives, by an evolution strategy that
/// adapts its covariance matrix (CMA-ES; Hansen, arXiv:1604.00772), from the middle of the cube from -1 to 1.
/// The same seed makes the same search.
struct EvolutionOptions {
  int dimensions = 6;
  int samples = 32;         ///< of a generation
  int generations = 40;     ///< at most
  double sigma = 0.6;       ///< standard deviation of the first one
  double precision = 0.03;  ///< it ends when the standard deviation is below this
  std::uint64_t seed = 1;
};

/// The values at points, one for one; points outside of the cube are moved into it before, and their values
/// reduced by their way.
using ValuesAt = std::function<std::vector<double>(std::span<const std::vector<double>> points)>;

struct Optimum {
  std::vector<double> point;
  double value;
};

/// The best of each generation, best first.
std::vector<Optimum> search_by_evolution(const EvolutionOptions& options, const ValuesAt& values_at);

}  // namespace xraycast
