#include "xraycast/trainer/page_motion.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/trainer/setup_numbers.hpp"

#include <glm/common.hpp>
#include <glm/vector_relational.hpp>

#include <algorithm>
#include <cmath>
#include <set>
#include <unordered_map>
#include <utility>

namespace xraycast {
namespace {

using NodeNumbers = std::unordered_map<std::uint64_t, std::size_t>;

/// Each node's own, of places within a kilometre.
std::uint64_t key_of(const PageMotion::Node& node) {
  // The sum is small.
  // NOLINTNEXTLINE(bugprone-misplaced-widening-cast)
  const auto part = [](std::int32_t i) { return static_cast<std::uint64_t>(i + (1 << 20)); };
  return part(node[0]) | part(node[1]) << 21 | part(node[2]) << 42;
}

/// The displacement of one key.
class NodeField final : public Displacement {
 public:
  NodeField(std::shared_ptr<const NodeNumbers> numbers, std::vector<std::int16_t> ways)
      : numbers_(std::move(numbers)), ways_(std::move(ways)) {}

  glm::dvec3 at(const glm::dvec3& x_mm) const override {
    const glm::dvec3 place = x_mm / PageMotion::kSpacing_mm, cell = glm::floor(place), part = place - cell;
    if (!(glm::all(glm::lessThan(glm::abs(cell), glm::dvec3(1 << 19))))) return glm::dvec3(0);
    glm::dvec3 sum(0);
    for (int corner = 0; corner < 8; ++corner) {
      const int x = corner & 1, y = corner >> 1 & 1, z = corner >> 2;
      const auto known =
          numbers_->find(key_of({static_cast<std::int32_t>(cell.x) + x, static_cast<std::int32_t>(cell.y) + y,
                                 static_cast<std::int32_t>(cell.z) + z}));
      if (known == numbers_->end()) continue;
      const double share = (x ? part.x : 1 - part.x) * (y ? part.y : 1 - part.y) * (z ? part.z : 1 - part.z);
      const std::int16_t* const way = &ways_[3 * known->second];
      sum += share * PageMotion::kUnit_mm * glm::dvec3(way[0], way[1], way[2]);
    }
    return sum;
  }
  bool covers(const glm::dvec3&) const override { return true; }

 private:
  std::shared_ptr<const NodeNumbers> numbers_;
  std::vector<std::int16_t> ways_;
};

/// All combinations of the modes' key phases.
std::vector<std::vector<double>> key_instants(const Motion& motion) {
  std::vector<std::vector<double>> instants{{}};
  for (const MotionMode& mode : motion.modes()) {
    std::vector<std::vector<double>> longer;
    for (const std::vector<double>& instant : instants)
      for (const KeyPhase& key : mode.keys) {
        longer.push_back(instant);
        longer.back().push_back(key.phase);
      }
    instants = std::move(longer);
  }
  return instants;
}

/// Of the cells that a ball touches.
void add_nodes(const glm::dvec3& middle_mm, double radius_mm, std::set<PageMotion::Node>& nodes) {
  const glm::dvec3 lower = glm::floor((middle_mm - radius_mm) / PageMotion::kSpacing_mm),
                   upper = glm::floor((middle_mm + radius_mm) / PageMotion::kSpacing_mm) + 1.0;
  for (auto x = static_cast<std::int32_t>(lower.x); x <= upper.x; ++x)
    for (auto y = static_cast<std::int32_t>(lower.y); y <= upper.y; ++y)
      for (auto z = static_cast<std::int32_t>(lower.z); z <= upper.z; ++z) nodes.insert({x, y, z});
}

/// About the vessels at all key phases.
std::set<PageMotion::Node> nodes_about(const VesselTree& tree, const Motion& motion) {
  constexpr double kApart_mm = 4;  // of the points that are looked at
  std::set<PageMotion::Node> nodes;
  for (const std::vector<double>& instant : key_instants(motion)) {
    const HeldMotion held = motion.held_at(instant);
    for (const VesselBranch& branch : tree.branches()) {
      double last_mm = -INFINITY;
      for (std::size_t i = 0; i < branch.points.size(); ++i) {
        const bool is_end = i + 1 == branch.points.size();
        if (branch.arc_length_mm[i] - last_mm < kApart_mm && !is_end) continue;
        last_mm = branch.arc_length_mm[i];
        const VesselPoint& point = branch.points[i];
        add_nodes(held.inverse_mm(point.position_mm).x_mm, point.radius_mm + PageMotion::kMargin_mm, nodes);
      }
    }
  }
  return nodes;
}

std::int16_t units_of(double mm) {
  constexpr double kMost = 32767;
  return static_cast<std::int16_t>(std::lround(std::clamp(mm / PageMotion::kUnit_mm, -kMost, kMost)));
}

}  // namespace

PageMotion PageMotion::about(const VesselTree& tree, const Motion& motion) {
  PageMotion page;
  std::vector<std::shared_ptr<const Displacement>> fields;
  for (const MotionMode& mode : motion.modes()) {
    Mode& of = page.modes.emplace_back(Mode{mode.name, mode.period_s, mode.waveform});
    for (const KeyPhase& key : mode.keys) {
      const auto known = std::find(fields.begin(), fields.end(), key.moves);
      of.phases.push_back(key.phase);
      of.fields.push_back(key.moves ? static_cast<int>(known - fields.begin()) : kStill);
      if (key.moves && known == fields.end()) fields.push_back(key.moves);
    }
  }
  const std::set<Node> nodes = nodes_about(tree, motion);
  std::vector<glm::dvec3> places_mm;
  for (const Node& node : nodes) places_mm.push_back(kSpacing_mm * glm::dvec3(node[0], node[1], node[2]));
  std::vector<std::vector<glm::dvec3>> ways_mm;
  for (const auto& field : fields) {
    ways_mm.emplace_back(places_mm.size(), glm::dvec3(0));
    field->add(places_mm, 1, ways_mm.back());
  }
  page.ways.resize(fields.size());
  std::size_t i = 0;
  for (const Node& node : nodes) {
    const auto moves = [i](const std::vector<glm::dvec3>& way_mm) {
      return units_of(way_mm[i].x) != 0 || units_of(way_mm[i].y) != 0 || units_of(way_mm[i].z) != 0;
    };
    if (std::any_of(ways_mm.begin(), ways_mm.end(), moves)) {
      page.nodes.push_back(node);
      for (std::size_t f = 0; f < fields.size(); ++f)
        for (int axis = 0; axis < 3; ++axis) page.ways[f].push_back(units_of(ways_mm[f][i][axis]));
    }
    ++i;
  }
  return page;
}

std::shared_ptr<const Motion> PageMotion::motion() const {
  const auto numbers = std::make_shared<NodeNumbers>();
  for (std::size_t i = 0; i < nodes.size(); ++i) (*numbers)[key_of(nodes[i])] = i;
  std::vector<std::shared_ptr<const Displacement>> displacements;
  for (const std::vector<std::int16_t>& way : ways)
    displacements.push_back(std::make_shared<NodeField>(numbers, way));
  std::vector<MotionMode> all;
  for (const Mode& mode : modes) {
    MotionMode& one = all.emplace_back(MotionMode{mode.name, mode.period_s, mode.waveform, {}});
    for (std::size_t k = 0; k < mode.phases.size(); ++k)
      one.keys.push_back({mode.phases[k], mode.fields[k] == kStill
                                              ? nullptr
                                              : displacements[static_cast<std::size_t>(mode.fields[k])]});
  }
  return std::make_shared<const Motion>(std::move(all), "motion");
}

void add_motion(const PageMotion& motion, std::vector<double>& numbers) {
  const auto add = [&](auto number) { numbers.push_back(static_cast<double>(number)); };
  add(motion.modes.size());
  if (motion.modes.empty()) return;
  for (const PageMotion::Mode& mode : motion.modes) {
    add(mode.name.size());
    for (const char byte : mode.name) add(static_cast<unsigned char>(byte));
    add(mode.period_s);
    add(mode.waveform.size());
    for (const PhaseSample& sample : mode.waveform) {
      add(sample.time_s);
      add(sample.phase);
    }
    add(mode.phases.size());
    for (std::size_t k = 0; k < mode.phases.size(); ++k) {
      add(mode.phases[k]);
      add(mode.fields[k]);
    }
  }
  add(motion.nodes.size());
  PageMotion::Node before{};
  for (const PageMotion::Node& node : motion.nodes) {
    for (std::size_t axis = 0; axis < 3; ++axis) add(node[axis] - before[axis]);
    before = node;
  }
  add(motion.ways.size());
  for (const std::vector<std::int16_t>& way : motion.ways)
    for (const std::int16_t units : way) add(units);
}

PageMotion page_motion_of(SetupNumbers& numbers) {
  PageMotion motion;
  motion.modes.resize(numbers.count());
  if (motion.modes.empty()) return motion;
  for (PageMotion::Mode& mode : motion.modes) {
    mode.name.resize(numbers.count());
    for (char& byte : mode.name) byte = static_cast<char>(static_cast<unsigned char>(numbers.index()));
    mode.period_s = numbers.real();
    mode.waveform.resize(numbers.count());
    for (PhaseSample& sample : mode.waveform) {
      sample.time_s = numbers.real();
      sample.phase = numbers.real();
    }
    const std::size_t keys = numbers.count();
    for (std::size_t k = 0; k < keys; ++k) {
      mode.phases.push_back(numbers.real());
      mode.fields.push_back(numbers.index());
    }
  }
  motion.nodes.resize(numbers.count());
  PageMotion::Node before{};
  for (PageMotion::Node& node : motion.nodes) {
    for (std::int32_t& place : before) place += numbers.whole(1 << 18);
    node = before;
  }
  motion.ways.resize(numbers.count());
  for (std::vector<std::int16_t>& way : motion.ways) {
    way.resize(3 * motion.nodes.size());
    for (std::int16_t& units : way) units = static_cast<std::int16_t>(numbers.whole(32767));
  }
  for (const PageMotion::Mode& mode : motion.modes)
    for (const int field : mode.fields)
      if (field >= std::ssize(motion.ways)) throw InputError("trainer: there is no field {}", field);
  return motion;
}

}  // namespace xraycast
