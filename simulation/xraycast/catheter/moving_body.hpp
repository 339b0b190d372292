#pragma once

#include "xraycast/motion/motion.hpp"

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <unordered_map>
#include <vector>

namespace xraycast {

/// The body about instruments at one instant of its motion: which place of the scan a place of the body
/// shows, quickly.
///
/// The displacements of a motion's keys are resampled at nodes kNode_mm apart, in bricks that are filled when
/// a place in them is first asked for, and are trilinear between nodes; a brick takes 0.05 to 0.5 ms. At an
/// instant they are summed cell by cell, by the weights of its phases, and modes are composed as in
/// HeldMotion. So places and derivatives are those of one continuous function at each instant. Looking up
/// fills caches: for one thread.
class MovingBody {
 public:
  static constexpr double kNode_mm = 3;

  /// At `phases`, one a mode; 0 of each where there are none.
  MovingBody(std::shared_ptr<const Motion> motion, std::span<const double> phases);

  /// To another instant. False where it is the same one.
  bool move_to(std::span<const double> phases);

  const Motion& motion() const { return *motion_; }
  const std::vector<double>& phases() const { return phases_; }  ///< one a mode

  /// No mode moves it, nor did an instant ago: it shows the scan itself.
  bool is_still() const { return is_still_; }

  /// Of the body about `body_mm`: what is seen at x lies at scan_mm + jacobian * (x - body_mm) in the scan.
  /// Vectors have a fourth number, 0, as the processor's do.
  struct Place {
    using Column = std::array<double, 4>;
    Column scan_mm, moved_mm;        ///< the latter since the instant before
    std::array<Column, 3> jacobian;  ///< by columns
  };
  Place place(const Eigen::Vector3d& body_mm);

 private:
  static constexpr std::int64_t kBrickCells = 4, kBrickNodes = kBrickCells + 1,
                                kNodesOfBrick = kBrickNodes * kBrickNodes * kBrickNodes;
  static constexpr std::size_t kCells = 1024;  ///< of a mode that are kept
  static constexpr std::size_t kWidth = 4;     ///< of a vector of three, so that it is one of the processor's
  using Node = std::array<float, kWidth>;      ///< a displacement in mm
  /// Of each key, kNodesOfBrick with x fastest; none where no key moves them.
  using Brick = std::vector<Node>;
  /// The cube between eight nodes: the displacement as a polynomial of the shares of the way through it along
  /// x, y and z, in the order 1, x, y, xy, z, xz, yz, xyz.
  struct alignas(64) Cell {
    std::array<std::array<double, kWidth>, 8> terms_mm, moved_mm;  ///< the latter since the instant before
    std::uint64_t number = 0;                                      ///< see number_of; 0: none yet
    std::int64_t instant = 0;                                      ///< whose weights the terms have
    const Node* corner = nullptr;  ///< of the first key; null where nothing moves
  };
  struct Mode {
    std::vector<std::shared_ptr<const Displacement>> keys;  ///< each once
    std::vector<std::size_t> key_of;                        ///< of the motion's keys; keys.size(): no field
    std::vector<double> weights, before;                    ///< of `keys`, now and an instant ago
    bool is_still = true;                                   ///< all of them 0
    std::unordered_map<std::uint64_t, Brick> bricks;
    std::vector<Cell> cells;
  };
  struct Found;

  void weigh();
  void weigh(std::size_t mode);
  const Node* corner_of(Mode& mode, const std::array<std::int64_t, 3>& cell);
  static Brick filled(const Mode& mode, const std::array<std::int64_t, 3>& brick);
  void find(Mode& mode, Cell& cell, std::uint64_t number, const std::array<std::int64_t, 3>& at);
  void blend(const Mode& mode, Cell& cell) const;
  template <typename Lanes>
  Found found(Mode& mode, const Lanes& place_mm);
  std::shared_ptr<const Motion> motion_;
  std::vector<double> phases_;
  std::vector<Mode> modes_;
  std::int64_t instant_ = 1;
  bool is_still_ = true;
};

}  // namespace xraycast
