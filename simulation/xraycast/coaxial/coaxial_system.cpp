#include "xraycast/coaxial/coaxial_system.hpp"

#include "xraycast/base/wide_vectors.hpp"

#include <algorithm>
#include <limits>

namespace xraycast {
namespace {

constexpr std::size_t kRows = BlockBandMatrix::kBlock;

using Scales = std::array<double, kRows>;
Scales scales_of(const RodWeights& weights, std::size_t k) {
  return {weights.theta[k], weights.position[k], weights.position[k], weights.position[k]};
}

}  // namespace

void CoaxialSystem::order(const std::vector<Rod>& rods) {
  places_.resize(rods.size());
  next_.assign(rods.size(), 1);
  std::size_t count = 0;
  for (std::size_t d = 0; d < rods.size(); ++d) {
    places_[d].resize(rods[d].node_count() - 1);
    count += places_[d].size();
  }
  const auto distance_mm = [&](std::size_t rod) {
    return next_[rod] < rods[rod].node_count() ? rods[rod].fed_mm() - rods[rod].from_tip_mm(next_[rod])
                                               : std::numeric_limits<double>::infinity();
  };
  for (std::size_t at = 0; at < count; ++at) {
    std::size_t nearest = 0;
    for (std::size_t d = 1; d < rods.size(); ++d)
      if (distance_mm(d) < distance_mm(nearest)) nearest = d;
    places_[nearest][next_[nearest]++ - 1] = at;
  }
  // A strain couples three nodes.
  reaches_.resize(count);
  for (const std::vector<std::size_t>& places : places_)
    for (std::size_t k = 0; k < places.size(); ++k)
      reaches_[places[k]] = places[std::min(k + 2, places.size() - 1)];
}

std::array<std::size_t, CoaxialSystem::kPairNodes> CoaxialSystem::places_of(const RodPair& pair) const {
  std::array<std::size_t, kPairNodes> places{};
  for (std::size_t k = 0; k < RodWeights::kNodes; ++k) {
    places[k] = place(pair.first_rod, pair.first.first_node + k);
    places[RodWeights::kNodes + k] = place(pair.second_rod, pair.second.first_node + k);
  }
  return places;
}

void CoaxialSystem::couple(const RodPair& pair) {
  std::size_t highest = kClamped, lowest = 0;
  for (const std::size_t place : places_of(pair)) {
    if (place == kClamped) continue;
    highest = std::min(highest, place);
    lowest = std::max(lowest, place);
  }
  // The matrix makes the columns between reach as far.
  if (highest != kClamped) reaches_[highest] = std::max(reaches_[highest], lowest);
}

void CoaxialSystem::collect(const std::vector<Rod>& rods) {
  hessian_.reset(reaches_);
  gradient_.assign(kRows * reaches_.size(), 0.0);
  for (std::size_t d = 0; d < rods.size(); ++d) {
    const RodSystem& own = rods[d].system_;
    const std::vector<std::size_t>& places = places_[d];
    for (std::size_t k = 0; k < places.size(); ++k) {
      const std::size_t first = RodSystem::theta_row(k);
      for (std::size_t c = 0; c < kRows; ++c) {
        gradient_[kRows * places[k] + c] = own.gradient_[first + c];
        const double* column = own.hessian_.column(first + c);
        // The column's entries below the diagonal, block by block.
        for (std::size_t b = 0; b < 3 && k + b < places.size(); ++b) {
          BlockBandMatrix::Block& block = hessian_.at(places[k + b], places[k]);
          for (std::size_t r = b == 0 ? c : 0; r < kRows; ++r)
            if (const std::size_t below = kRows * b + r - c; below <= BandMatrix::kBand)
              block[kRows * c + r] = column[below];
        }
      }
    }
  }
}

XRAYCAST_WIDE_VECTORS
void CoaxialSystem::add(const RodPair& pair, const Vector8& gradient, const Matrix8& hessian) {
  const std::array<std::size_t, kPairNodes> places = places_of(pair);
  std::array<Scales, kPairNodes> scales{};
  for (std::size_t k = 0; k < RodWeights::kNodes; ++k) {
    scales[k] = scales_of(pair.first, k);
    scales[RodWeights::kNodes + k] = scales_of(pair.second, k);
  }
  const double* entries = hessian.data();  // column by column
  for (std::size_t a = 0; a < kPairNodes; ++a) {
    if (places[a] == kClamped) continue;
    const std::size_t row = a < RodWeights::kNodes ? 0 : kRows;
    for (std::size_t r = 0; r < kRows; ++r)
      gradient_[kRows * places[a] + r] += scales[a][r] * gradient[static_cast<Eigen::Index>(row + r)];
    for (std::size_t b = 0; b < kPairNodes; ++b) {
      if (places[b] == kClamped || places[b] > places[a]) continue;
      const std::size_t column = b < RodWeights::kNodes ? 0 : kRows;
      double* block = hessian_.at(places[a], places[b]).data();
      for (std::size_t c = 0; c < kRows; ++c) {
        const double* from = entries + 2 * kRows * (column + c) + row;
        for (std::size_t r = 0; r < kRows; ++r)
          block[kRows * c + r] += scales[a][r] * (scales[b][c] * from[r]);
      }
    }
  }
}

void CoaxialSystem::add_gradient(const RodPair& pair, double scale, const NodeVectors& vectors) {
  const std::array<std::size_t, kPairNodes> places = places_of(pair);
  for (std::size_t a = 0; a < kPairNodes; ++a) {
    if (places[a] == kClamped) continue;
    for (std::size_t r = 0; r < kRows; ++r)
      gradient_[kRows * places[a] + r] += scale * vectors[a][static_cast<Eigen::Index>(r)];
  }
}

XRAYCAST_WIDE_VECTORS
void CoaxialSystem::add_product(const RodPair& pair, double scale, const NodeVectors& vectors) {
  const std::array<std::size_t, kPairNodes> places = places_of(pair);
  for (std::size_t a = 0; a < kPairNodes; ++a) {
    if (places[a] == kClamped) continue;
    const double* rows = vectors[a].data();
    for (std::size_t b = 0; b < kPairNodes; ++b) {
      if (places[b] == kClamped || places[b] > places[a]) continue;
      double* block = hessian_.at(places[a], places[b]).data();
      for (std::size_t c = 0; c < kRows; ++c) {
        const double by = scale * vectors[b][static_cast<Eigen::Index>(c)];
        for (std::size_t r = 0; r < kRows; ++r) block[kRows * c + r] += by * rows[r];
      }
    }
  }
}

double CoaxialSystem::solve(std::vector<Rod>& rods) {
  direction_.resize(gradient_.size());
  for (std::size_t r = 0; r < gradient_.size(); ++r) direction_[r] = -gradient_[r];
  hessian_.solve(direction_.data());
  double model_decrease_uJ = 0;
  for (std::size_t r = 0; r < gradient_.size(); ++r) model_decrease_uJ -= 0.5 * gradient_[r] * direction_[r];
  for (std::size_t d = 0; d < rods.size(); ++d) {
    rods[d].direction_.assign(rods[d].row_count() + BandMatrix::kBand, 0.0);
    for (std::size_t k = 0; k < places_[d].size(); ++k)
      std::copy_n(direction_.begin() + static_cast<std::ptrdiff_t>(kRows * places_[d][k]), kRows,
                  rods[d].direction_.begin() + static_cast<std::ptrdiff_t>(RodSystem::theta_row(k)));
  }
  return model_decrease_uJ;
}

}  // namespace xraycast
