#include "xraycast/geometry/segment_index.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <limits>

namespace xraycast {
namespace {

constexpr std::uint32_t kLeafSize = 4;

/// Nodes still to visit. Halving 2^32 segments leaves at most 32 levels, each with one sibling waiting.
template <typename T>
class Stack {
 public:
  void push(const T& item) { items_[static_cast<std::size_t>(size_++)] = item; }
  T pop() { return items_[static_cast<std::size_t>(--size_)]; }
  bool empty() const { return size_ == 0; }

 private:
  std::array<T, 64> items_;
  int size_ = 0;
};

double squared(double x) { return x * x; }
double squared_length(const glm::dvec3& v) { return glm::dot(v, v); }

double squared_distance_to_box(const glm::dvec3& point, const glm::dvec3& lower, const glm::dvec3& upper) {
  return squared_length(point - glm::clamp(point, lower, upper));
}

/// Of a segment's centreline.
struct Foot {
  double fraction, squared_mm;
};

Foot foot_of(const glm::dvec3& point, const SegmentIndex::Segment& segment) {
  const glm::dvec3 axis = segment.end_mm - segment.start_mm, offset = point - segment.start_mm;
  const double fraction = std::clamp(glm::dot(offset, axis) / squared_length(axis), 0.0, 1.0);
  return {fraction, squared_length(offset - fraction * axis)};
}

/// The hull of two spheres is the union of all spheres between them. The one that reaches furthest towards
/// the point stands off the foot of the perpendicular, towards the thick end, by the cone's slope.
bool capsule_contains(const SegmentIndex::Segment& segment, const glm::dvec3& point) {
  const glm::dvec3 axis = segment.end_mm - segment.start_mm;
  const glm::dvec3 offset = point - segment.start_mm;
  const double length = glm::length(axis);
  const double foot = glm::dot(offset, axis) / length;
  const double height = std::sqrt(std::max(0.0, squared_length(offset) - squared(foot)));
  const double slope = (segment.end_radius_mm - segment.start_radius_mm) / length;
  double along = slope > 0 ? length : 0;  // from a slope of 1 on, the thick end's sphere holds all the others
  if (std::abs(slope) < 1)
    along = std::clamp(foot + height * slope / std::sqrt(1 - squared(slope)), 0.0, length);
  return squared(foot - along) + squared(height) <= squared(segment.start_radius_mm + slope * along);
}

}  // namespace

SegmentIndex::SegmentIndex(std::vector<Segment> segments) : segments_(std::move(segments)) {
  assert(!segments_.empty());
  build(0, static_cast<std::uint32_t>(segments_.size()));
}

void SegmentIndex::build(std::uint32_t first, std::uint32_t last) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  Node node{glm::dvec3(kInfinity), glm::dvec3(-kInfinity), 0, first, last - first};
  for (std::uint32_t i = first; i < last; ++i) {
    const Segment& segment = segments_[i];
    node.lower_mm = glm::min(node.lower_mm, glm::min(segment.start_mm, segment.end_mm));
    node.upper_mm = glm::max(node.upper_mm, glm::max(segment.start_mm, segment.end_mm));
    node.max_radius_mm = std::max({node.max_radius_mm, segment.start_radius_mm, segment.end_radius_mm});
  }
  const std::size_t self = nodes_.size();
  nodes_.push_back(node);
  if (node.count <= kLeafSize) return;

  const glm::dvec3 extent = node.upper_mm - node.lower_mm;
  const int axis = extent.x >= extent.y && extent.x >= extent.z ? 0 : extent.y >= extent.z ? 1 : 2;
  const std::uint32_t middle = first + node.count / 2;
  std::nth_element(segments_.begin() + first, segments_.begin() + middle, segments_.begin() + last,
                   [axis](const Segment& a, const Segment& b) {
                     return a.start_mm[axis] + a.end_mm[axis] < b.start_mm[axis] + b.end_mm[axis];
                   });
  build(first, middle);
  nodes_[self].first = static_cast<std::uint32_t>(nodes_.size());
  nodes_[self].count = 0;
  build(middle, last);
}

template <typename Accept>
void SegmentIndex::search(const glm::dvec3& point_mm, Found& best, const Accept& accept) const {
  struct Candidate {
    std::uint32_t node;
    double squared_mm;
  };
  const auto candidate = [&](std::uint32_t node) -> Candidate {
    return {node, squared_distance_to_box(point_mm, nodes_[node].lower_mm, nodes_[node].upper_mm)};
  };

  Stack<Candidate> waiting;
  waiting.push(candidate(0));
  while (!waiting.empty()) {
    const auto [index, squared_mm] = waiting.pop();
    if (squared_mm >= best.squared_mm) continue;
    const Node& node = nodes_[index];
    if (node.count == 0) {  // the nearer child on top
      Candidate near = candidate(index + 1), far = candidate(node.first);
      if (far.squared_mm < near.squared_mm) std::swap(near, far);
      waiting.push(far);
      waiting.push(near);
      continue;
    }
    for (std::uint32_t i = node.first; i < node.first + node.count; ++i) {
      const Foot foot = foot_of(point_mm, segments_[i]);
      const Found found{&segments_[i], foot.fraction, foot.squared_mm};
      if (found.squared_mm < best.squared_mm && accept(found)) best = found;
    }
  }
}

SegmentIndex::Nearest SegmentIndex::nearest(const glm::dvec3& point_mm) const {
  const Segment& first = segments_.front();
  Found best{&first, 0, squared_length(point_mm - first.start_mm)};
  search(point_mm, best, [](const Found&) { return true; });
  return {*best.segment, best.fraction, std::sqrt(best.squared_mm)};
}

std::optional<SegmentIndex::Nearest> SegmentIndex::nearest(
    const glm::dvec3& point_mm, double within_mm, const std::function<bool(const Nearest&)>& accept) const {
  Found best{nullptr, 0, std::nextafter(squared(within_mm), std::numeric_limits<double>::infinity())};
  search(point_mm, best, [&](const Found& found) {
    return accept({*found.segment, found.fraction, std::sqrt(found.squared_mm)});
  });
  if (!best.segment) return {};
  return Nearest{*best.segment, best.fraction, std::sqrt(best.squared_mm)};
}

double SegmentIndex::Nearest::radius_mm() const {
  return std::lerp(segment.start_radius_mm, segment.end_radius_mm, fraction);
}

SegmentIndex::Nearest SegmentIndex::deepest(const glm::dvec3& point_mm) const {
  const Segment* best = nullptr;
  Foot best_foot{};
  double best_out_mm = std::numeric_limits<double>::infinity();
  const auto squared_mm = [&](std::uint32_t node) {
    return squared_distance_to_box(point_mm, nodes_[node].lower_mm, nodes_[node].upper_mm);
  };
  Stack<std::uint32_t> waiting;
  waiting.push(0);
  while (!waiting.empty()) {
    const std::uint32_t index = waiting.pop();
    const Node& node = nodes_[index];
    const double within_mm = best_out_mm + node.max_radius_mm;
    if (within_mm <= 0 || squared_mm(index) >= squared(within_mm)) continue;
    if (node.count == 0) {  // the nearer child on top
      std::uint32_t near = index + 1, far = node.first;
      if (squared_mm(far) < squared_mm(near)) std::swap(near, far);
      waiting.push(far);
      waiting.push(near);
      continue;
    }
    for (std::uint32_t i = node.first; i < node.first + node.count; ++i) {
      const Foot foot = foot_of(point_mm, segments_[i]);
      const Nearest found{segments_[i], foot.fraction, std::sqrt(foot.squared_mm)};
      if (found.out_mm() >= best_out_mm) continue;
      best = &segments_[i];
      best_foot = foot;
      best_out_mm = found.out_mm();
    }
  }
  return {*best, best_foot.fraction, std::sqrt(best_foot.squared_mm)};
}

bool SegmentIndex::inside(const glm::dvec3& point_mm) const {
  Stack<std::uint32_t> waiting;
  waiting.push(0);
  while (!waiting.empty()) {
    const std::uint32_t index = waiting.pop();
    const Node& node = nodes_[index];
    if (squared_distance_to_box(point_mm, node.lower_mm, node.upper_mm) > squared(node.max_radius_mm))
      continue;
    if (node.count == 0) {
      waiting.push(node.first);
      waiting.push(index + 1);
      continue;
    }
    for (std::uint32_t i = node.first; i < node.first + node.count; ++i)
      if (capsule_contains(segments_[i], point_mm)) return true;
  }
  return false;
}

}  // namespace xraycast
