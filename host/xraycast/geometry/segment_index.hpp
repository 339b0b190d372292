#pragma once

#include <glm/vec3.hpp>

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

namespace xraycast {

/// Line segments with a radius at either end, arranged so that the one nearest to a point is found in
/// logarithmic time: a bounding volume hierarchy, split at the median of the widest axis. Immutable, so safe
/// to share.
class SegmentIndex {
 public:
  struct Segment {
    glm::dvec3 start_mm, end_mm;  ///< apart from each other
    double start_radius_mm, end_radius_mm;
    int branch, point;  ///< its start's position in the original tree; only carried along
  };

  /// One segment or more.
  explicit SegmentIndex(std::vector<Segment> segments);

  struct Nearest {
    const Segment& segment;  ///< lives as long as the index
    double fraction;         ///< of the way from its start to its end
    double distance_mm;
    double radius_mm() const;
    /// How far the point is out of the sphere there; negative within.
    double out_mm() const { return distance_mm - radius_mm(); }
  };
  Nearest nearest(const glm::dvec3& point_mm) const;

  /// The nearest of those places within `within_mm` that are accepted: of each segment its own nearest one is
  /// asked for.
  std::optional<Nearest> nearest(const glm::dvec3& point_mm, double within_mm,
                                 const std::function<bool(const Nearest&)>& accept) const;

  /// The place in whose sphere a point lies deepest, or whose sphere is nearest to it: the least distance
  /// less radius. Of each segment its nearest place is asked for.
  Nearest deepest(const glm::dvec3& point_mm) const;

  /// Whether a point lies in any of the tapered capsules: the hulls of the spheres around both ends of a
  /// segment.
  bool inside(const glm::dvec3& point_mm) const;

 private:
  /// One cache line. Children are stored after their parent, the left one directly, so that only the right
  /// one needs an index.
  struct Node {
    glm::dvec3 lower_mm, upper_mm;  ///< bounds of the segments without their radii, see `max_radius_mm`
    double max_radius_mm;
    std::uint32_t first;  ///< leaf: its first segment; else: its right child
    std::uint32_t count;  ///< leaf: number of segments; else: 0
  };

  struct Found {
    const Segment* segment;
    double fraction, squared_mm;
  };

  void build(std::uint32_t first, std::uint32_t last);

  /// Replaces `best` by what is nearer and accepted.
  template <typename Accept>
  void search(const glm::dvec3& point_mm, Found& best, const Accept& accept) const;

  std::vector<Segment> segments_;
  std::vector<Node> nodes_;
};

}  // namespace xraycast
