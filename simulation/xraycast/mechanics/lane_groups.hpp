#pragma once

#include "xraycast/mechanics/contact_groups.hpp"
#include "xraycast/mechanics/lanes.hpp"
#include "xraycast/mechanics/rod.hpp"

#include <Eigen/Core>
#include <cstddef>

namespace xraycast {

// Groups of contacts as vectors of the processor.

static_assert(kContactGroup == kLanes);

[[gnu::always_inline]] inline Lanes lanes_of(const GroupNumbers& numbers) { return load(numbers.data()); }
[[gnu::always_inline]] inline Triple<Lanes> triple_of(const GroupVectors& vectors) {
  return {lanes_of(vectors[0]), lanes_of(vectors[1]), lanes_of(vectors[2])};
}
[[gnu::always_inline]] inline void store_triple(GroupVectors& to, const Triple<Lanes>& from) {
  store(to[0].data(), from.x);
  store(to[1].data(), from.y);
  store(to[2].data(), from.z);
}
inline void set_lane(const Eigen::Vector3d& vector, std::size_t k, GroupVectors& to) {
  for (std::size_t c = 0; c < 3; ++c) to[c][k] = vector[static_cast<Eigen::Index>(c)];
}

/// The positions of four nodes, or of those `after` places after them.
[[gnu::always_inline]] inline Triple<Lanes> positions_mm(const RodState& state, const LaneIndices& at,
                                                         std::size_t after) {
  return gathered_triple<Lanes, Eigen::Vector3d>(
      lane_sources(state.nodes_mm, at, after), [](const Eigen::Vector3d& node) -> auto& { return node; });
}

}  // namespace xraycast
