#include "xraycast/catheter/moving_body.hpp"

#include "xraycast/base/wide_vectors.hpp"
#include "xraycast/mechanics/lanes.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

namespace xraycast {
namespace {

using Eigen::Vector3d;
using CellIndex = std::array<std::int64_t, 3>;

constexpr double kCellsPer_mm = 1 / MovingBody::kNode_mm;
// Cells are numbered within this distance of the scan's zero, beyond which nothing moves.
constexpr std::int64_t kFarthest = 1 << 20;

/// Each has its own, above 0.
std::uint64_t number_of(const CellIndex& at) {
  const auto part = [](std::int64_t i) { return static_cast<std::uint64_t>(i + kFarthest); };
  return 1 + (part(at[0]) | part(at[1]) << 21 | part(at[2]) << 42);
}

std::size_t slot_of(std::uint64_t number, std::size_t slots) {
  // Fibonacci hashing: of neighbours all bits differ.
  return static_cast<std::size_t>((number * 0x9e3779b97f4a7c15ULL) >> 40) % slots;
}

/// Not what is no number, too.
[[gnu::always_inline]] inline bool is_within_reach(const Lanes& place_mm) {
  constexpr double kReach_mm = MovingBody::kNode_mm * (kFarthest - 1);
  return std::abs(place_mm[0]) < kReach_mm && std::abs(place_mm[1]) < kReach_mm &&
         std::abs(place_mm[2]) < kReach_mm;
}

/// Of values at a cell's corners: differences along x, then y, then z.
[[gnu::always_inline]] inline void store_terms(std::array<Lanes, 8>& corners,
                                               std::array<std::array<double, 4>, 8>& to) {
  for (const std::size_t axis : {1U, 2U, 4U})
    for (std::size_t c = 0; c < 8; ++c)
      if (c & axis) corners[c] -= corners[c - axis];
  for (std::size_t c = 0; c < 8; ++c) store(to[c].data(), corners[c]);
}

using NarrowLanes __attribute__((vector_size(4 * sizeof(float)))) = float;

[[gnu::always_inline]] inline Lanes wide(const std::array<float, 4>& values) {
  NarrowLanes narrow;
  std::memcpy(&narrow, values.data(), sizeof narrow);
  return __builtin_convertvector(narrow, Lanes);
}

}  // namespace

MovingBody::MovingBody(std::shared_ptr<const Motion> motion, std::span<const double> phases)
    : motion_(std::move(motion)), phases_(phases.begin(), phases.end()) {
  if (phases_.empty()) phases_.resize(motion_->modes().size(), 0.0);
  for (const MotionMode& of : motion_->modes()) {
    Mode& mode = modes_.emplace_back();
    for (const KeyPhase& key : of.keys) {
      const auto known = std::find(mode.keys.begin(), mode.keys.end(), key.moves);
      mode.key_of.push_back(static_cast<std::size_t>(known - mode.keys.begin()));
      if (!key.moves) mode.key_of.back() = of.keys.size();
      if (key.moves && known == mode.keys.end()) mode.keys.push_back(key.moves);
    }
    mode.weights.resize(mode.keys.size());
    mode.cells.resize(kCells);
  }
  weigh();
}

bool MovingBody::move_to(std::span<const double> phases) {
  if (std::equal(phases.begin(), phases.end(), phases_.begin(), phases_.end())) return false;
  phases_.assign(phases.begin(), phases.end());
  ++instant_;
  weigh();
  return true;
}

void MovingBody::weigh() {
  for (std::size_t m = 0; m < modes_.size(); ++m) weigh(m);
  is_still_ = std::all_of(modes_.begin(), modes_.end(), [](const Mode& mode) { return mode.is_still; });
}

/// By the phase now.
void MovingBody::weigh(std::size_t index) {
  Mode& mode = modes_[index];
  mode.before = mode.weights;
  std::fill(mode.weights.begin(), mode.weights.end(), 0.0);
  const std::vector<double> weights = motion_->modes()[index].weights_at(phases_[index]);
  for (std::size_t k = 0; k < weights.size(); ++k)
    if (mode.key_of[k] < mode.keys.size()) mode.weights[mode.key_of[k]] += weights[k];
  const auto are_zero = [](const std::vector<double>& all) {
    return std::all_of(all.begin(), all.end(), [](double weight) { return weight == 0; });
  };
  mode.is_still = are_zero(mode.weights) && are_zero(mode.before);
}

// ---- nodes and cells ------------------------------------------------------------------------------------

MovingBody::Brick MovingBody::filled(const Mode& mode, const CellIndex& brick) {
  std::vector<glm::dvec3> nodes_mm;
  for (std::int64_t k = 0; k < kBrickNodes; ++k)
    for (std::int64_t j = 0; j < kBrickNodes; ++j)
      for (std::int64_t i = 0; i < kBrickNodes; ++i)
        nodes_mm.push_back(kNode_mm * glm::dvec3(brick[0] * kBrickCells + i, brick[1] * kBrickCells + j,
                                                 brick[2] * kBrickCells + k));
  Brick values;
  values.reserve(mode.keys.size() * nodes_mm.size());
  for (const auto& key : mode.keys) {
    std::vector<glm::dvec3> displacements_mm(nodes_mm.size(), glm::dvec3(0));
    key->add(nodes_mm, 1, displacements_mm);
    for (const glm::dvec3& d : displacements_mm)
      values.push_back({static_cast<float>(d.x), static_cast<float>(d.y), static_cast<float>(d.z), 0});
  }
  return std::all_of(values.begin(), values.end(), [](const Node& node) { return node == Node{}; }) ? Brick()
                                                                                                    : values;
}

/// The first key's node with the least coordinates; null where nothing moves.
const MovingBody::Node* MovingBody::corner_of(Mode& mode, const CellIndex& cell) {
  CellIndex brick, within;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    brick[axis] = cell[axis] >> 2;  // kBrickCells, rounded down
    within[axis] = cell[axis] & 3;
  }
  const std::uint64_t number = number_of(brick);
  auto found = mode.bricks.find(number);
  if (found == mode.bricks.end()) found = mode.bricks.emplace(number, filled(mode, brick)).first;
  if (found->second.empty()) return nullptr;
  return &found->second[static_cast<std::size_t>((within[2] * kBrickNodes + within[1]) * kBrickNodes +
                                                 within[0])];
}

/// The cell that is wanted takes the place of the one that was kept there.
void MovingBody::find(Mode& mode, Cell& cell, std::uint64_t number, const CellIndex& at) {
  if (cell.number != number) {
    cell.corner = corner_of(mode, at);
    cell.number = number;
  }
  blend(mode, cell);
  cell.instant = instant_;
}

XRAYCAST_WIDE_VECTORS
void MovingBody::blend(const Mode& mode, Cell& cell) const {
  constexpr std::array<std::int64_t, 8> kCorners{0,
                                                 1,
                                                 kBrickNodes,
                                                 kBrickNodes + 1,
                                                 kBrickNodes * kBrickNodes,
                                                 kBrickNodes * kBrickNodes + 1,
                                                 kBrickNodes * (kBrickNodes + 1),
                                                 kBrickNodes * (kBrickNodes + 1) + 1};
  if (!cell.corner) return;
  std::array<Lanes, 8> terms{}, moved{};
  const Node* from = cell.corner;
  for (std::size_t key = 0; key < mode.weights.size(); ++key, from += kNodesOfBrick) {
    if (mode.weights[key] == 0 && mode.before[key] == 0) continue;
    const Lanes weight = all<Lanes>(mode.weights[key]), by = all<Lanes>(mode.weights[key] - mode.before[key]);
    for (std::size_t c = 0; c < 8; ++c) {
      const Lanes node_mm = wide(from[kCorners[c]]);
      terms[c] += weight * node_mm;
      moved[c] += by * node_mm;
    }
  }
  store_terms(terms, cell.terms_mm);
  store_terms(moved, cell.moved_mm);
}

// ---- places ---------------------------------------------------------------------------------------------

/// A place's cell, and how far through it the place lies.
struct MovingBody::Found {
  using Terms = std::array<std::array<double, kWidth>, 8>;
  const Cell* cell;
  double x, y, z;

  [[gnu::always_inline]] Lanes at(const Terms& of) const {
    const Lanes lower = (load(of[0].data()) + x * load(of[1].data())) +
                        y * (load(of[2].data()) + x * load(of[3].data())),
                upper = (load(of[4].data()) + x * load(of[5].data())) +
                        y * (load(of[6].data()) + x * load(of[7].data()));
    return lower + z * upper;
  }
  /// The displacement's derivatives by the place.
  [[gnu::always_inline]] std::array<Lanes, 3> slopes() const {
    const auto term = [this](std::size_t number) __attribute__((always_inline)) {
      return load(cell->terms_mm[number].data());
    };
    const Lanes xy = term(3) + z * term(7);
    return {kCellsPer_mm * ((term(1) + z * term(5)) + y * xy),
            kCellsPer_mm * ((term(2) + z * term(6)) + x * xy),
            kCellsPer_mm * ((term(4) + x * term(5)) + y * (term(6) + x * term(7)))};
  }
};

template <typename Lanes>
[[gnu::always_inline]] inline MovingBody::Found MovingBody::found(Mode& mode, const Lanes& place_mm) {
  const Lanes nodes = kCellsPer_mm * place_mm;
  CellIndex at;
  for (std::size_t axis = 0; axis < 3; ++axis) at[axis] = static_cast<std::int64_t>(std::floor(nodes[axis]));
  const std::uint64_t number = number_of(at);
  Cell& cell = mode.cells[slot_of(number, kCells)];
  if (cell.number != number || cell.instant != instant_) find(mode, cell, number, at);
  return {&cell, nodes[0] - static_cast<double>(at[0]), nodes[1] - static_cast<double>(at[1]),
          nodes[2] - static_cast<double>(at[2])};
}

XRAYCAST_WIDE_VECTORS
MovingBody::Place MovingBody::place(const Vector3d& body_mm) {
  std::array<Lanes, 3> columns{Lanes{1, 0, 0, 0}, Lanes{0, 1, 0, 0}, Lanes{0, 0, 1, 0}};
  Lanes scan_mm{body_mm[0], body_mm[1], body_mm[2], 0}, moved_mm{};
  for (Mode& mode : modes_) {
    if (mode.is_still || !is_within_reach(scan_mm)) continue;
    const Found found = this->found(mode, scan_mm);
    if (!found.cell->corner) continue;
    const std::array<Lanes, 3> slopes = found.slopes();
    const auto taken_along = [&slopes](const Lanes& way) __attribute__((always_inline)) {
      return way + (way[0] * slopes[0] + way[1] * slopes[1] + way[2] * slopes[2]);
    };
    for (Lanes& column : columns) column = taken_along(column);
    moved_mm = taken_along(moved_mm) + found.at(found.cell->moved_mm);
    scan_mm += found.at(found.cell->terms_mm);
  }
  Place place;
  store(place.scan_mm.data(), scan_mm);
  store(place.moved_mm.data(), moved_mm);
  for (std::size_t axis = 0; axis < 3; ++axis) store(place.jacobian[axis].data(), columns[axis]);
  return place;
}

}  // namespace xraycast
