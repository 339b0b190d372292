#pragma once

#include "xraycast/mechanics/block_band_matrix.hpp"

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <span>
#include <vector>

namespace xraycast {

struct RodPoint;

/// One rod's part of a RodSystem. Each of its nodes from number 1 on has four rows: the angle of the edge
/// before it, and its position.
class RodRows {
 public:
  /// Where the derivatives by a node go: its rows of the gradient, and of the Hessian the blocks, by columns,
  /// of its columns with the rows of itself, of the next node and of the one after that. What there is no
  /// row for, because it is clamped or beyond the tip, has a place of its own.
  struct Node {
    double* gradient;
    std::array<double*, 3> blocks;
  };

  /// Adds a potential's gradient (mN mm, mN) and Hessian over the angle, first, and the position of a point.
  void add(const RodPoint& point, const Eigen::Vector4d& gradient, const Eigen::Matrix4d& hessian) const;

  /// A node, and after it the following ones: from -1 on, the ghost node before the clamp, as an edge begins
  /// there.
  const Node* node(std::ptrdiff_t number) const { return nodes_.data() + number + 1; }
  /// Three that have no rows.
  const Node* none() const { return nodes_.data() + nodes_.size() - 3; }

 private:
  friend class RodSystem;
  explicit RodRows(std::span<const Node> nodes) : nodes_(nodes) {}

  std::span<const Node> nodes_;
};

/// A point of one rod and a place on another's centreline, each of which moves with three nodes: the rods and
/// the first of the nodes.
struct RodPair {
  std::size_t point_rod = 0, point_node = 0, curve_rod = 0, curve_node = 0;
};

/// The derivatives of a potential between the two, over the turn and the distance of the point from the place
/// (a vector of four) and over the slope of the centreline there (four, of which the first is zero).
struct PairDerivatives {
  static constexpr std::size_t kOfEach = 3, kNodes = 2 * kOfEach;
  /// Of the nodes' changes, each the angle of the edge before and the position: the point's and the curve's
  /// nodes.
  std::array<Eigen::Vector4d, kNodes> motion_weights;
  std::array<double, kOfEach> slope_weights;  ///< of the curve's nodes
  Eigen::Vector4d by_motion, by_slope;
  /// The Hessian over both, motion_slope with a row for the motion and a column for the slope.
  Eigen::Matrix4d motion, motion_slope, slope;
};

/// The linear system of one Newton iteration of rods fed through one clamp, in mm, kg, s. The nodes of all,
/// each with the angle of the edge before it, follow each other by their distance from the clamp, so that
/// what lies side by side lies near the matrix's diagonal.
class RodSystem {
 public:
  /// Allocates for so many nodes.
  void reserve(std::size_t nodes);

  /// Orders the nodes by their distances along the rods, of each rod's.
  void order(const std::vector<std::vector<double>>& along_mm);

  /// Announces what `add` will couple; before `reset`.
  void couple(const RodPair& pair);

  /// Sets all entries to zero.
  void reset();

  /// After `reset`.
  RodRows rows(std::size_t rod) const { return RodRows(rows_[rod]); }

  /// What acts on node 0 is left to the clamp, and its reaction does not count it: the introducer keeps
  /// instruments straight there, where they hardly touch. Several potentials of one pair, with the same
  /// weights of the point, are written at once, since writing is what takes the time.
  void add(const RodPair& pair, std::span<const PairDerivatives> derivatives);

  /// False unless the Hessian is positive definite.
  bool factorise() { return hessian_.factorise(); }

  /// Finds Newton's direction. Returns the decrease of the potential by its quadratic model.
  double solve();

  /// That direction, in a rod's rows.
  void copy_direction(std::size_t rod, std::vector<double>& to) const;

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
  std::vector<std::vector<RodRows::Node>> rows_;  ///< of each rod
  BlockBandMatrix::Block no_rows_{};
  BlockBandMatrix hessian_;
  std::vector<double> gradient_, direction_;
};

}  // namespace xraycast
