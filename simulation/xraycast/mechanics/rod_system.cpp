#include "xraycast/mechanics/rod_system.hpp"

#include "xraycast/base/wide_vectors.hpp"
#include "xraycast/mechanics/lane_columns.hpp"
#include "xraycast/mechanics/lanes.hpp"
#include "xraycast/mechanics/rod.hpp"

#include <algorithm>
#include <limits>

namespace xraycast {
namespace {

constexpr std::size_t kRows = BlockBandMatrix::kBlock;

}  // namespace

XRAYCAST_WIDE_VECTORS
void RodRows::add(const RodPoint& point, const Eigen::Vector4d& gradient,
                  const Eigen::Matrix4d& hessian) const {
  const Node* node = this->node(static_cast<std::ptrdiff_t>(point.edge));
  const Lanes by_point = load(gradient.data());
  const LaneColumns of_point = load_columns(hessian.data());
  const auto add_block = [&](double* to, const Lanes& rows, const Lanes& columns)
      __attribute__((always_inline)) {
    add_to_columns(to, columns_scaled(rows_scaled(of_point, rows), columns));
  };
  // Of the edge's second node with the edge's angle, its first one, and the next edge's angle.
  const double by_start = point.start_weight, by_end = point.end_weight;
  const Lanes end{point.theta_weight, by_end, by_end, by_end};
  add_to(node[1].gradient, end * by_point);
  add_block(node[1].blocks[0], end, end);
  if (by_start != 0) {
    const Lanes start{0, by_start, by_start, by_start};
    add_to(node[0].gradient, start * by_point);
    add_block(node[0].blocks[0], start, start);
    add_block(node[0].blocks[1], end, start);
  }
  if (point.next_theta_weight != 0) {
    const Lanes next{point.next_theta_weight, 0, 0, 0};
    add_to(node[2].gradient, next * by_point);
    add_block(node[1].blocks[1], next, end);
    add_to(node[2].blocks[0], next * (next * of_point[0]));
  }
}

void RodSystem::reserve(std::size_t nodes) {
  constexpr std::size_t kBlocksANode = 6;  // of a pair
  reaches_.reserve(nodes);
  hessian_.reserve(nodes, kBlocksANode * nodes);
  gradient_.reserve(kRows * nodes);
  direction_.reserve(kRows * nodes);
}

void RodSystem::order(const std::vector<std::vector<double>>& along_mm) {
  places_.resize(along_mm.size());
  next_.assign(along_mm.size(), 1);
  std::size_t count = 0;
  for (std::size_t d = 0; d < along_mm.size(); ++d) {
    places_[d].resize(along_mm[d].size() - 1);
    count += places_[d].size();
  }
  const auto distance_mm = [&](std::size_t rod) {
    return next_[rod] < along_mm[rod].size() ? along_mm[rod][next_[rod]]
                                             : std::numeric_limits<double>::infinity();
  };
  for (std::size_t at = 0; at < count; ++at) {
    std::size_t nearest = 0;
    for (std::size_t d = 1; d < along_mm.size(); ++d)
      if (distance_mm(d) < distance_mm(nearest)) nearest = d;
    places_[nearest][next_[nearest]++ - 1] = at;
  }
  // A strain couples three nodes.
  reaches_.resize(count);
  for (const std::vector<std::size_t>& places : places_)
    for (std::size_t k = 0; k < places.size(); ++k)
      reaches_[places[k]] = places[std::min(k + 2, places.size() - 1)];
}

RodSystem::PairPlaces RodSystem::places_of(const RodPair& pair) const {
  PairPlaces places;
  for (std::size_t k = 0; k < PairDerivatives::kOfEach; ++k) {
    places[k] = place(pair.point_rod, pair.point_node + k);
    places[PairDerivatives::kOfEach + k] = place(pair.curve_rod, pair.curve_node + k);
  }
  return places;
}

void RodSystem::couple(const RodPair& pair) {
  std::size_t highest = kClamped, lowest = 0;
  for (const std::size_t place : places_of(pair)) {
    if (place == kClamped) continue;
    highest = std::min(highest, place);
    lowest = std::max(lowest, place);
  }
  // The matrix makes the columns between reach as far.
  if (highest != kClamped) reaches_[highest] = std::max(reaches_[highest], lowest);
}

void RodSystem::reset() {
  hessian_.reset(reaches_);
  gradient_.assign(kRows * reaches_.size(), 0.0);
  rows_.resize(places_.size());
  for (std::size_t d = 0; d < places_.size(); ++d) {
    const std::vector<std::size_t>& places = places_[d];
    // Two that are clamped, and three of none.
    rows_[d].assign(places.size() + 5,
                    {no_rows_.data(), {no_rows_.data(), no_rows_.data(), no_rows_.data()}});
    for (std::size_t k = 0; k < places.size(); ++k) {
      RodRows::Node& node = rows_[d][k + 2];
      node.gradient = &gradient_[kRows * places[k]];
      for (std::size_t b = 0; b < node.blocks.size() && k + b < places.size(); ++b)
        node.blocks[b] = hessian_.at(places[k + b], places[k]).data();
    }
  }
}

namespace {

/// What one potential's Hessian has for a node of the curve: its columns for the motion and for the slope.
struct CurveRows {
  LaneColumns by_motion, by_slope;

  [[gnu::always_inline]] CurveRows(const PairDerivatives& of, std::size_t k) {
    const Lanes weights = load(of.motion_weights[PairDerivatives::kOfEach + k].data());
    const LaneColumns motion_slope = load_columns(of.motion_slope.data());
    by_motion = sum(rows_scaled(load_columns(of.motion.data()), weights),
                    rows_scaled(transposed(motion_slope), of.slope_weights[k]));
    by_slope = sum(rows_scaled(motion_slope, weights),
                   rows_scaled(load_columns(of.slope.data()), of.slope_weights[k]));
  }
  /// Its columns for another node, or the same.
  [[gnu::always_inline]] LaneColumns block(const PairDerivatives& of, std::size_t k) const {
    return sum(columns_scaled(by_motion, load(of.motion_weights[PairDerivatives::kOfEach + k].data())),
               rows_scaled(by_slope, of.slope_weights[k]));
  }
};
[[gnu::always_inline]] inline Lanes curve_gradient(const PairDerivatives& of, std::size_t k) {
  return load(of.motion_weights[PairDerivatives::kOfEach + k].data()) * load(of.by_motion.data()) +
         of.slope_weights[k] * load(of.by_slope.data());
}

}  // namespace

/// Of one potential, or of two; `last` is the second one.
template <bool kTwo>
[[gnu::always_inline]] inline void RodSystem::add_several(const PairPlaces& places,
                                                          const PairDerivatives& first,
                                                          const PairDerivatives& last) {
  constexpr std::size_t kNodes = PairDerivatives::kOfEach;
  std::array<Lanes, kNodes> weights;
  for (std::size_t k = 0; k < kNodes; ++k) weights[k] = load(first.motion_weights[k].data());
  // The point's nodes with each other.
  LaneColumns motion = load_columns(first.motion.data());
  Lanes by_motion = load(first.by_motion.data());
  if constexpr (kTwo) {
    motion = sum(motion, load_columns(last.motion.data()));
    by_motion += load(last.by_motion.data());
  }
  for (std::size_t a = 0; a < kNodes; ++a) {
    if (places[a] == kClamped) continue;
    add_to(&gradient_[kRows * places[a]], weights[a] * by_motion);
    const LaneColumns rows = rows_scaled(motion, weights[a]);
    for (std::size_t b = 0; b <= a; ++b)
      if (places[b] != kClamped)
        add_to_columns(hessian_.at(places[a], places[b]).data(), columns_scaled(rows, weights[b]));
  }
  // The curve's with the point's, and with each other.
  for (std::size_t k = 0; k < kNodes; ++k) {
    const std::size_t a = places[kNodes + k];
    if (a == kClamped) continue;
    Lanes gradient = curve_gradient(first, k);
    const CurveRows rows_of_first(first, k), rows_of_last(last, k);
    LaneColumns rows = rows_of_first.by_motion;
    if constexpr (kTwo) {
      gradient += curve_gradient(last, k);
      rows = sum(rows, rows_of_last.by_motion);
    }
    add_to(&gradient_[kRows * a], gradient);
    for (const std::size_t point : {0, 1, 2}) {
      const std::size_t b = places[point];
      if (b == kClamped) continue;
      const LaneColumns block = columns_scaled(rows, weights[point]);
      if (b < a)
        add_to_columns(hessian_.at(a, b).data(), block);
      else
        add_to_columns(hessian_.at(b, a).data(), transposed(block));
    }
    for (std::size_t l = 0; l <= k; ++l) {
      const std::size_t b = places[kNodes + l];
      if (b == kClamped) continue;
      LaneColumns block = rows_of_first.block(first, l);
      if constexpr (kTwo) block = sum(block, rows_of_last.block(last, l));
      add_to_columns(hessian_.at(a, b).data(), block);
    }
  }
}

XRAYCAST_WIDE_VECTORS
void RodSystem::add(const RodPair& pair, std::span<const PairDerivatives> derivatives) {
  const PairPlaces places = places_of(pair);
  if (derivatives.size() == 1)
    add_several<false>(places, derivatives.front(), derivatives.front());
  else
    add_several<true>(places, derivatives.front(), derivatives.back());
}

double RodSystem::solve() {
  direction_.resize(gradient_.size());
  for (std::size_t r = 0; r < gradient_.size(); ++r) direction_[r] = -gradient_[r];
  hessian_.solve(direction_.data());
  double model_decrease_uJ = 0;
  for (std::size_t r = 0; r < gradient_.size(); ++r) model_decrease_uJ -= 0.5 * gradient_[r] * direction_[r];
  return model_decrease_uJ;
}

XRAYCAST_WIDE_VECTORS
void RodSystem::copy_direction(std::size_t rod, std::vector<double>& to) const {
  to.resize(kRows * places_[rod].size());
  for (std::size_t k = 0; k < places_[rod].size(); ++k)
    store(&to[kRows * k], load(&direction_[kRows * places_[rod][k]]));
}

}  // namespace xraycast
