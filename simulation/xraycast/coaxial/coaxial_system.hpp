#pragma once

#include "xraycast/coaxial/block_band_matrix.hpp"
#include "xraycast/coaxial/rod_curve.hpp"
#include "xraycast/mechanics/rod.hpp"

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <span>
#include <vector>

namespace xraycast {

/// A point of one rod and a place on another's centreline, each of which moves with three nodes: the rods and
/// the first of the nodes.
struct RodPair {
  std::size_t point_rod = 0, point_node = 0, curve_rod = 0, curve_node = 0;
};

/// The derivatives of a potential between the two, over the turn and the distance of the point from the place
/// (a vector of four) and over the slope of the centreline there (four, of which the first is zero).
struct PairDerivatives {
  static constexpr std::size_t kNodes = 2 * RodWeights::kNodes;
  /// Of the nodes' changes, each the angle of the edge before and the position: the point's and the curve's
  /// nodes.
  std::array<Eigen::Vector4d, kNodes> motion_weights;
  std::array<double, RodWeights::kNodes> slope_weights;  ///< of the curve's nodes
  Eigen::Vector4d by_motion, by_slope;
  /// The Hessian over both, motion_slope with a row for the motion and a column for the slope.
  Eigen::Matrix4d motion, motion_slope, slope;
};

/// The linear system of one Newton iteration of several rods fed through one clamp, in mm, kg, s. The nodes
/// of all, each with the angle of the edge before it, follow each other by their distance from the clamp, so
/// that what lies side by side lies near the matrix's diagonal.
class CoaxialSystem {
 public:
  /// Orders the nodes by their distances along the rods, of each rod's.
  void order(const std::vector<std::vector<double>>& along_mm);

  /// Announces what `add` will couple; before `collect`.
  void couple(const RodPair& pair);

  /// The rods' own systems.
  void collect(const std::vector<Rod>& rods);

  /// What acts on node 0 is left to the clamp, and its reaction does not count it: the introducer keeps
  /// devices straight there, where they hardly touch. Several potentials of one pair, with the same weights
  /// of the point, are written at once, since writing is what takes the time.
  void add(const RodPair& pair, std::span<const PairDerivatives> derivatives);

  /// False unless the Hessian is positive definite.
  bool factorise() { return hessian_.factorise(); }

  /// Newton's direction, in the rows of each rod's own system. Returns the decrease of the potential by its
  /// quadratic model.
  double solve(std::vector<Rod>& rods);

 private:
  static constexpr std::size_t kClamped = static_cast<std::size_t>(-1);
  using PairPlaces = std::array<std::size_t, PairDerivatives::kNodes>;
  /// The place of a node in the order; kClamped for number 0.
  std::size_t place(std::size_t rod, std::size_t node) const {
    return node == 0 ? kClamped : places_[rod][node - 1];
  }
  PairPlaces places_of(const RodPair& pair) const;
  template <bool kTwo>
  void add_several(const PairPlaces& places, const PairDerivatives& first, const PairDerivatives& last);

  std::vector<std::vector<std::size_t>> places_;  ///< of each rod's nodes from number 1 on
  std::vector<std::size_t> reaches_, next_;
  BlockBandMatrix hessian_;
  std::vector<double> gradient_, direction_;
};

}  // namespace xraycast
