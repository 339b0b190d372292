#include "xraycast/export/packed_lattice.hpp"

#include "xraycast/export/packed_mesh.hpp"
#include "xraycast/export/packed_numbers.hpp"
#include "xraycast/motion/moving_points.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

namespace xraycast {
namespace {

using Cell = std::array<std::int64_t, 3>;

/// As a page has the place, which is rounded.
Cell cell_of(const glm::vec3& place_mm) {
  Cell cell{};
  for (int axis = 0; axis < 3; ++axis) {
    const double shown_mm = std::round(double{place_mm[axis]} / PackedMesh::kUnit_mm) * PackedMesh::kUnit_mm;
    cell[static_cast<std::size_t>(axis)] =
        static_cast<std::int64_t>(std::floor(shown_mm / PackedLattice::kSpacing_mm));
  }
  return cell;
}

/// The grid's nodes, and the numbers of those that are corners of the places' cells.
std::set<std::int64_t> choose_nodes(std::span<const glm::vec3> places_mm, PackedLattice& lattice) {
  std::set<Cell> cells;
  for (const glm::vec3& place_mm : places_mm) cells.insert(cell_of(place_mm));
  Cell lower, upper;
  lower.fill(std::numeric_limits<std::int64_t>::max());
  upper.fill(std::numeric_limits<std::int64_t>::lowest());
  for (const Cell& cell : cells)
    for (std::size_t axis = 0; axis < 3; ++axis) {
      lower[axis] = std::min(lower[axis], cell[axis]);
      upper[axis] = std::max(upper[axis], cell[axis] + 1);
    }
  lattice.first = lower;
  for (std::size_t axis = 0; axis < 3; ++axis) lattice.size[axis] = upper[axis] - lower[axis] + 1;
  std::set<std::int64_t> numbers;
  for (const Cell& cell : cells)
    for (int corner = 0; corner < 8; ++corner) {
      const std::int64_t x = cell[0] - lower[0] + (corner & 1), y = cell[1] - lower[1] + (corner >> 1 & 1),
                         z = cell[2] - lower[2] + (corner >> 2);
      numbers.insert((z * lattice.size[1] + y) * lattice.size[0] + x);
    }
  return numbers;
}

std::vector<glm::vec3> places_of(const std::set<std::int64_t>& numbers, const PackedLattice& lattice) {
  std::vector<glm::vec3> places_mm;
  for (const std::int64_t number : numbers) {
    const std::int64_t row = number / lattice.size[0];
    const Cell node{lattice.first[0] + number % lattice.size[0], lattice.first[1] + row % lattice.size[1],
                    lattice.first[2] + row / lattice.size[1]};
    places_mm.push_back(static_cast<float>(PackedLattice::kSpacing_mm) *
                        glm::vec3(node[0], node[1], node[2]));
  }
  return places_mm;
}

}  // namespace

PackedLattice pack_lattice(std::span<const glm::vec3> places_mm, const Motion& motion, Progress& progress) {
  PackedLattice lattice;
  const std::set<std::int64_t> numbers = choose_nodes(places_mm, lattice);
  lattice.nodes = numbers.size();
  PackedNumbers packed;
  std::int64_t before = 0;
  for (const std::int64_t number : numbers) {
    packed.add(number - before);
    before = number;
  }
  lattice.numbers = packed.bytes();
  const std::vector<glm::vec3> rest_mm = places_of(numbers, lattice);
  constexpr double kTolerance_mm = 0.1;  // a tenth of a page's pixel
  const MovingPoints points(rest_mm, motion, progress, kTolerance_mm);
  lattice.phases = points.key_phases();
  std::size_t keys = 1;
  for (const std::vector<double>& phases : lattice.phases) keys *= phases.size();
  std::vector<std::int64_t> last(3 * rest_mm.size());
  PackedNumbers ways;
  for (std::size_t key = 0; key < keys; ++key) {
    std::vector<double> instant(lattice.phases.size());
    for (std::size_t m = instant.size(), rest = key; m-- > 0; rest /= lattice.phases[m].size())
      instant[m] = lattice.phases[m][rest % lattice.phases[m].size()];
    const std::vector<glm::vec3> moved_mm = points.at(instant);
    for (int axis = 0; axis < 3; ++axis)
      for (std::size_t i = 0; i < rest_mm.size(); ++i) {
        const std::int64_t way =
            std::llround(double{moved_mm[i][axis] - rest_mm[i][axis]} / PackedLattice::kUnit_mm);
        std::int64_t& its_last = last[static_cast<std::size_t>(axis) * rest_mm.size() + i];
        ways.add(way - its_last);
        its_last = way;
      }
  }
  lattice.ways = ways.bytes();
  return lattice;
}

}  // namespace xraycast
