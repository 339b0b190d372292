#pragma once

#include "xraycast/coaxial/block_band_matrix.hpp"
#include "xraycast/coaxial/rod_curve.hpp"
#include "xraycast/mechanics/rod.hpp"

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <vector>

namespace xraycast {

/// What acts between a point of one rod and one of another, which move with the nodes by these weights.
struct RodPair {
  std::size_t first_rod = 0, second_rod = 0;
  RodWeights first, second;
};

/// The linear system of one Newton iteration of several rods fed through one clamp, in mm, kg, s. The nodes
/// of all, each with the angle of the edge before it, follow each other by their distance from the clamp, so
/// that what lies side by side lies near the matrix's diagonal.
class CoaxialSystem {
 public:
  /// What the angle of the edge before a node and the node's position count, for each node of the first rod
  /// and then of the second.
  using NodeVectors = std::array<Eigen::Vector4d, 2 * RodWeights::kNodes>;
  /// `scale` times the outer product of the vectors.
  struct Square {
    double scale = 0;
    NodeVectors vectors;
  };
  /// A Hessian: `stiffness` over the distance of the two points, and squares. Summed up first, since writing
  /// it into the matrix is what takes the time.
  struct Hessian {
    static constexpr std::size_t kMostSquares = 3;
    Eigen::Matrix3d stiffness = Eigen::Matrix3d::Zero();
    std::array<Square, kMostSquares> squares;
    std::size_t count = 0;

    void clear() {
      stiffness.setZero();
      count = 0;
    }
    Square& add_square(double scale) {
      squares[count].scale = scale;
      return squares[count++];
    }
  };

  /// Orders the nodes.
  void order(const std::vector<Rod>& rods);

  /// Announces what `add` will couple; before `collect`.
  void couple(const RodPair& pair);

  /// The rods' own systems.
  void collect(const std::vector<Rod>& rods);

  /// What acts on node 0 is left to the clamp, and its reaction does not count it: the introducer keeps
  /// devices straight there, where they hardly touch.
  void add(const RodPair& pair, const Hessian& hessian);
  /// A force between the points, on the second one and, negative, on the first.
  void add_gradient(const RodPair& pair, const Eigen::Vector3d& force_mN);
  /// Adds `scale` times the vectors to the gradient.
  void add_gradient(const RodPair& pair, double scale, const NodeVectors& vectors);

  /// False unless the Hessian is positive definite.
  bool factorise() { return hessian_.factorise(); }

  /// Newton's direction, in the rows of each rod's own system. Returns the decrease of the potential by its
  /// quadratic model.
  double solve(std::vector<Rod>& rods);

 private:
  static constexpr std::size_t kPairNodes = 2 * RodWeights::kNodes, kClamped = static_cast<std::size_t>(-1);
  /// The place of a node in the order; kClamped for number 0.
  std::size_t place(std::size_t rod, std::size_t node) const {
    return node == 0 ? kClamped : places_[rod][node - 1];
  }
  std::array<std::size_t, kPairNodes> places_of(const RodPair& pair) const;

  std::vector<std::vector<std::size_t>> places_;  ///< of each rod's nodes from number 1 on
  std::vector<std::size_t> reaches_, next_;
  BlockBandMatrix hessian_;
  std::vector<double> gradient_, direction_;
};

}  // namespace xraycast
