#pragma once

#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/motion/motion.hpp"

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

namespace xraycast {

class SetupNumbers;

/// How a body moves about the vessels of a page: a motion's displacements at nodes of a grid about everywhere
/// the vessels come, trilinear between them and none beyond. Quick to pack, and small.
struct PageMotion {
  static constexpr double kSpacing_mm = 8, kUnit_mm = 1.0 / 64;
  static constexpr double kMargin_mm = 4;  ///< about the vessels' walls, which instruments press outwards
  static constexpr int kStill = -1;        ///< a key that shows the scan itself

  using Node = std::array<std::int32_t, 3>;  ///< its place, in spacings
  struct Mode {
    std::string name;
    double period_s = 0;
    std::vector<PhaseSample> waveform{};
    std::vector<double> phases{};  ///< of its keys
    std::vector<int> fields{};     ///< of its keys: numbers of `ways`, or kStill
  };

  std::vector<Mode> modes{};
  std::vector<Node> nodes{};
  std::vector<std::vector<std::int16_t>> ways{};  ///< displacements in units, x, y and z of each node

  /// Nodes are kept where anything moves.
  static PageMotion about(const VesselTree& tree, const Motion& motion);

  /// The same as a motion.
  std::shared_ptr<const Motion> motion() const;
};

/// In order: the number of modes, and of each its name as bytes behind their number, period, number of
/// samples of its waveform with time and phase of each, number of keys, and phase and field of each; the
/// number of nodes, and x, y and z of each as differences from the one before; the number of fields, and the
/// ways of each. No modes: nothing behind that.
void add_motion(const PageMotion& motion, std::vector<double>& numbers);
PageMotion page_motion_of(SetupNumbers& numbers);

}  // namespace xraycast
