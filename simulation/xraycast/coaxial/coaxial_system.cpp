#include "xraycast/coaxial/coaxial_system.hpp"

#include "xraycast/base/wide_vectors.hpp"
#include "xraycast/mechanics/lanes.hpp"

#include <algorithm>
#include <limits>

namespace xraycast {
namespace {

constexpr std::size_t kRows = BlockBandMatrix::kBlock;

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

XRAYCAST_WIDE_VECTORS
void CoaxialSystem::collect(const std::vector<Rod>& rods) {
  hessian_.reset(reaches_);
  gradient_.assign(kRows * reaches_.size(), 0.0);
  for (std::size_t d = 0; d < rods.size(); ++d) {
    const RodSystem& own = rods[d].system_;
    const std::vector<std::size_t>& places = places_[d];
    for (std::size_t k = 0; k < places.size(); ++k) {
      const std::size_t first = RodSystem::theta_row(k);
      store(&gradient_[kRows * places[k]], load(&own.gradient_[first]));
      // The entries below the diagonal, block by block; a band's column is zero beyond them.
      BlockBandMatrix::Block& diagonal = hessian_.at(places[k], places[k]);
      for (std::size_t c = 0; c < kRows; ++c)
        std::copy_n(own.hessian_.column(first + c), kRows - c, diagonal.begin() + kRows * c + c);
      for (std::size_t b = 1; b < 3 && k + b < places.size(); ++b) {
        BlockBandMatrix::Block& block = hessian_.at(places[k + b], places[k]);
        for (std::size_t c = 0; c < kRows; ++c)
          store(&block[kRows * c], load(own.hessian_.column(first + c) + kRows * b - c));
      }
    }
  }
}

namespace {

/// Of the distance of the two points: minus for the second one.
double weight_of(const RodPair& pair, std::size_t a) {
  return a < RodWeights::kNodes ? pair.first.position[a] : -pair.second.position[a - RodWeights::kNodes];
}

/// The processor's vector of four.
using Four __attribute__((vector_size(4 * sizeof(double)), aligned(sizeof(double)))) = double;

inline const Four& four(const Eigen::Vector4d& values) {
  return *reinterpret_cast<const Four*>(values.data());
}

/// A Hessian as columns of four: of the stiffness, and of each square's vectors.
struct Columns {
  static constexpr std::size_t kNodes = 2 * RodWeights::kNodes;
  Four stiffness[3];
  double weights[kNodes];
};

/// Adds the block of two nodes, a below b.
template <std::size_t kSquares>
inline void add_block(const CoaxialSystem::Hessian& hessian, const Columns& columns, std::size_t a,
                      std::size_t b, double* block) {
  const double weight = columns.weights[a] * columns.weights[b];
  Four rows[kSquares + 1];
  for (std::size_t k = 0; k < kSquares; ++k)
    rows[k] = hessian.squares[k].scale * four(hessian.squares[k].vectors[a]);
  for (std::size_t c = 0; c < kRows; ++c) {
    Four& column = *reinterpret_cast<Four*>(block + kRows * c);
    Four sum = column;
    if (c > 0) sum += weight * columns.stiffness[c - 1];
    for (std::size_t k = 0; k < kSquares; ++k)
      sum += rows[k] * hessian.squares[k].vectors[b][static_cast<Eigen::Index>(c)];
    column = sum;
  }
}

template <std::size_t kSquares>
inline void add_blocks(const CoaxialSystem::Hessian& hessian, const Columns& columns,
                       const std::array<std::size_t, Columns::kNodes>& places, std::size_t clamped,
                       BlockBandMatrix& matrix) {
  for (std::size_t a = 0; a < Columns::kNodes; ++a)
    for (std::size_t b = 0; places[a] != clamped && b < Columns::kNodes; ++b)
      if (places[b] <= places[a])
        add_block<kSquares>(hessian, columns, a, b, matrix.at(places[a], places[b]).data());
}

}  // namespace

XRAYCAST_WIDE_VECTORS
void CoaxialSystem::add(const RodPair& pair, const Hessian& hessian) {
  Columns columns;
  for (std::size_t c = 0; c < 3; ++c) {
    const auto at = static_cast<Eigen::Index>(c);
    columns.stiffness[c] =
        Four{0, hessian.stiffness(0, at), hessian.stiffness(1, at), hessian.stiffness(2, at)};
  }
  for (std::size_t a = 0; a < kPairNodes; ++a) columns.weights[a] = weight_of(pair, a);
  const std::array<std::size_t, kPairNodes> places = places_of(pair);
  switch (hessian.count) {
    case 0:
      return add_blocks<0>(hessian, columns, places, kClamped, hessian_);
    case 1:
      return add_blocks<1>(hessian, columns, places, kClamped, hessian_);
    case 2:
      return add_blocks<2>(hessian, columns, places, kClamped, hessian_);
    default:
      return add_blocks<3>(hessian, columns, places, kClamped, hessian_);
  }
}

void CoaxialSystem::add_gradient(const RodPair& pair, const Eigen::Vector3d& force_mN) {
  const std::array<std::size_t, kPairNodes> places = places_of(pair);
  for (std::size_t a = 0; a < kPairNodes; ++a) {
    if (places[a] == kClamped) continue;
    for (std::size_t r = 0; r < 3; ++r)
      gradient_[kRows * places[a] + 1 + r] += weight_of(pair, a) * force_mN[static_cast<Eigen::Index>(r)];
  }
}

void CoaxialSystem::add_gradient(const RodPair& pair, double scale, const NodeVectors& vectors) {
  const std::array<std::size_t, kPairNodes> places = places_of(pair);
  for (std::size_t a = 0; a < kPairNodes; ++a)
    if (places[a] != kClamped) add_to(&gradient_[kRows * places[a]], scale * load(vectors[a].data()));
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
