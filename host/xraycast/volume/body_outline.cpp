#include "xraycast/volume/body_outline.hpp"

#include "xraycast/base/error.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <functional>
#include <iterator>
#include <map>
#include <utility>

namespace xraycast {
namespace {

constexpr std::int16_t kBodyHu = -300;
constexpr double kGrid_mm = 3;
constexpr double kOpening_mm = 5;  // to each side
constexpr double kFineGrid_mm = 1;

/// Erodes (keep = all) or dilates (keep = any) one line of `n` cells, `stride` apart, by `reach` to each
/// side. Beyond the line's ends there is nothing to erode from: a body cut by the scan's edge is not opened
/// there.
template <bool kErode>
void filter_line(std::uint8_t* line, std::int64_t n, std::int64_t stride, std::int64_t reach,
                 std::vector<std::uint8_t>& copy) {
  copy.resize(static_cast<std::size_t>(n));
  for (std::int64_t i = 0; i < n; ++i) copy[i] = line[i * stride];
  constexpr std::uint8_t kWanted = kErode ? 0 : 1;
  std::int64_t last = -reach - 1;  // the last cell that decides
  for (std::int64_t i = 0, ahead = 0; i < n; ++i) {
    for (; ahead < n && ahead <= i + reach; ++ahead)
      if (copy[ahead] == kWanted) last = ahead;
    // `last` may lie ahead of a nearer one, but any decider in [i - reach, i + reach] is enough.
    line[i * stride] = last >= i - reach ? kWanted : copy[i];
  }
}

void open_slice(std::uint8_t* cells, const Index3& size, std::int64_t reach_x, std::int64_t reach_y) {
  std::vector<std::uint8_t> copy;
  for (std::int64_t y = 0; y < size.y; ++y) filter_line<true>(cells + y * size.x, size.x, 1, reach_x, copy);
  for (std::int64_t x = 0; x < size.x; ++x) filter_line<true>(cells + x, size.y, size.x, reach_y, copy);
  for (std::int64_t x = 0; x < size.x; ++x) filter_line<false>(cells + x, size.y, size.x, reach_y, copy);
  for (std::int64_t y = 0; y < size.y; ++y) filter_line<false>(cells + y * size.x, size.x, 1, reach_x, copy);
}

/// The cells of the 6-connected components, the largest first. Visited cells of `dense` become 0.
std::vector<std::vector<std::int64_t>> components(std::vector<std::uint8_t>& dense, const Index3& size) {
  std::vector<std::vector<std::int64_t>> all;
  const std::int64_t slice = size.x * size.y;
  for (std::int64_t seed = 0; seed < static_cast<std::int64_t>(dense.size()); ++seed) {
    if (!dense[seed]) continue;
    std::vector<std::int64_t> current{seed};
    dense[seed] = 0;
    for (std::size_t next = 0; next < current.size(); ++next) {
      const std::int64_t cell = current[next], x = cell % size.x, y = cell / size.x % size.y;
      const auto visit = [&](bool exists, std::int64_t neighbour) {
        if (!exists || !dense[neighbour]) return;
        dense[neighbour] = 0;
        current.push_back(neighbour);
      };
      visit(x > 0, cell - 1);
      visit(x + 1 < size.x, cell + 1);
      visit(y > 0, cell - size.x);
      visit(y + 1 < size.y, cell + size.x);
      visit(cell >= slice, cell - slice);
      visit(cell + slice < static_cast<std::int64_t>(dense.size()), cell + slice);
    }
    all.push_back(std::move(current));
  }
  std::ranges::stable_sort(all, std::greater<>(), &std::vector<std::int64_t>::size);
  return all;
}

/// Whether a part of the scan is as an arm or a leg: as thick, through many slices, and about as wide as
/// high, which tables, pads and cushions are not.
bool is_limb(const std::vector<std::int64_t>& part, const Index3& size, const glm::dvec3& cell_mm) {
  constexpr double kLeast_mm3 = 150e3, kThinnest_mm2 = 800, kShortest_mm = 50, kFlattest = 3, kEmptiest = 0.5;
  if (static_cast<double>(part.size()) * cell_mm.x * cell_mm.y * cell_mm.z < kLeast_mm3) return false;
  struct Slice {
    std::int64_t low_x = INT64_MAX, high_x = -1, low_y = INT64_MAX, high_y = -1, cells = 0;
  };
  std::map<std::int64_t, Slice> slices;
  for (const std::int64_t cell : part) {
    const std::int64_t x = cell % size.x, y = cell / size.x % size.y;
    Slice& slice = slices[cell / (size.x * size.y)];
    slice = {std::min(slice.low_x, x), std::max(slice.high_x, x), std::min(slice.low_y, y),
             std::max(slice.high_y, y), slice.cells + 1};
  }
  double width_mm = 0, height_mm = 0, area_mm2 = 0, box_mm2 = 0;  // sums over the slices
  for (const auto& [z, slice] : slices) {
    const double w_mm = static_cast<double>(slice.high_x - slice.low_x + 1) * cell_mm.x,
                 h_mm = static_cast<double>(slice.high_y - slice.low_y + 1) * cell_mm.y;
    width_mm += w_mm;
    height_mm += h_mm;
    box_mm2 += w_mm * h_mm;
    area_mm2 += static_cast<double>(slice.cells) * cell_mm.x * cell_mm.y;
  }
  const auto count = static_cast<double>(slices.size());
  return count * cell_mm.z >= kShortest_mm && area_mm2 >= kThinnest_mm2 * count &&
         std::max(width_mm, height_mm) <= kFlattest * std::min(width_mm, height_mm) &&
         area_mm2 >= kEmptiest * box_mm2;
}

std::int64_t stride_for(double grid_mm, double spacing_mm) {
  return std::max<std::int64_t>(1, std::llround(grid_mm / spacing_mm));
}

Index3 strides_for(double grid_mm, const glm::dvec3& spacing_mm) {
  return {stride_for(grid_mm, spacing_mm.x), stride_for(grid_mm, spacing_mm.y),
          stride_for(grid_mm, spacing_mm.z)};
}

std::int64_t reach_for(double cell_mm) {
  return std::max<std::int64_t>(0, std::llround(kOpening_mm / cell_mm));
}

}  // namespace

OutlineFinder::OutlineFinder(const VolumeGeometry& geometry, OutlineOptions options)
    : geometry_(geometry),
      options_(options),
      stride_(strides_for(kGrid_mm, geometry.spacing_mm)),
      size_((geometry.size + stride_ - Index3(1)) / stride_),
      fine_stride_(strides_for(kFineGrid_mm, geometry.spacing_mm)),
      fine_size_((geometry.size + fine_stride_ - Index3(1)) / fine_stride_),
      fine_words_((fine_size_.x + 63) / 64) {
  dense_.reserve(static_cast<std::size_t>(size_.x * size_.y * size_.z));
}

void OutlineFinder::add(std::span<const std::int16_t> hu) {
  const std::int64_t slice = geometry_.slice_voxels(), count = static_cast<std::int64_t>(hu.size()) / slice;
  for (std::int64_t z = 0; z < count; ++z, ++slices_seen_) {
    if (options_.finds_skin && slices_seen_ % fine_stride_.z == 0) add_fine(hu.subspan(z * slice, slice));
    if (slices_seen_ % stride_.z != 0) continue;
    for (std::int64_t y = 0; y < geometry_.size.y; y += stride_.y)
      for (std::int64_t x = 0; x < geometry_.size.x; x += stride_.x)
        dense_.push_back(hu[z * slice + y * geometry_.size.x + x] > kBodyHu);
  }
}

namespace {

/// Where 64 voxels lie above the threshold.
std::uint64_t dense_bits(const std::int16_t* hu, std::int64_t stride, std::int64_t count) {
  std::array<std::uint8_t, 64> above{};
  for (std::int64_t i = 0; i < count; ++i) above[i] = hu[i * stride] > kBodyHu;
  std::uint64_t bits = 0;
  for (int eight = 0; eight < 8; ++eight) {
    std::uint64_t bytes = 0;
    std::memcpy(&bytes, &above[8 * eight], 8);
    bits |= (bytes * 0x0102040810204080ULL) >> 56 << 8 * eight;  // bit i is that of byte i
  }
  return bits;
}

}  // namespace

void OutlineFinder::add_fine(std::span<const std::int16_t> slice) {
  for (std::int64_t y = 0; y < fine_size_.y; ++y) {
    const std::int16_t* row = &slice[y * fine_stride_.y * geometry_.size.x];
    for (std::int64_t first = 0; first < fine_size_.x; first += 64)
      fine_.push_back(dense_bits(row + first * fine_stride_.x, fine_stride_.x,
                                 std::min<std::int64_t>(64, fine_size_.x - first)));
  }
}

/// The cells of the body on the coarse grid.
const OutlineFinder::BodyCells& OutlineFinder::body_cells() const {
  if (!body_cells_.all.empty()) return body_cells_;
  const glm::dvec3 cell_mm = geometry_.spacing_mm * glm::dvec3(stride_);
  std::vector<std::uint8_t> opened = dense_;
  for (std::size_t first = 0; first < opened.size(); first += static_cast<std::size_t>(size_.x * size_.y))
    open_slice(opened.data() + first, size_, reach_for(cell_mm.x), reach_for(cell_mm.y));
  std::vector<std::vector<std::int64_t>> parts = components(opened, size_);
  if (parts.empty()) {  // a body thinner than the opening, such as a phantom in air
    opened = dense_;
    parts = components(opened, size_);
    if (!parts.empty()) parts.resize(1);
  }
  if (parts.empty())
    throw InputError("nothing in the scan lies above {} HU, so no body was found; give a centre and a radius",
                     kBodyHu);
  body_cells_ = {std::move(parts[0]), 0, 0};
  body_cells_.trunk = body_cells_.all.size();
  for (std::size_t part = 1; part < parts.size(); ++part) {
    if (!is_limb(parts[part], size_, cell_mm)) continue;
    ++body_cells_.limbs;
    std::ranges::copy(parts[part], std::back_inserter(body_cells_.all));
  }
  return body_cells_;
}

/// The sides at which the body fills 1 cm2 of the scan's border or more; none where it does so at all four,
/// as in a part of a body, or without air.
std::vector<std::string> OutlineFinder::cut_sides() const {
  constexpr double kLeast_mm2 = 100;
  const glm::dvec3 cell_mm = geometry_.spacing_mm * glm::dvec3(stride_);
  std::array<double, 4> cut_mm2{};
  for (const std::int64_t cell : body_cells().all) {
    const std::int64_t x = cell % size_.x, y = cell / size_.x % size_.y;
    if (x == 0) cut_mm2[0] += cell_mm.y * cell_mm.z;
    if (x == size_.x - 1) cut_mm2[1] += cell_mm.y * cell_mm.z;
    if (y == 0) cut_mm2[2] += cell_mm.x * cell_mm.z;
    if (y == size_.y - 1) cut_mm2[3] += cell_mm.x * cell_mm.z;
  }
  constexpr std::array kSides{"right", "left", "anterior", "posterior"};
  std::vector<std::string> sides;
  for (std::size_t side = 0; side < kSides.size(); ++side)
    if (cut_mm2[side] >= kLeast_mm2) sides.emplace_back(kSides[side]);
  if (sides.size() == kSides.size()) sides.clear();
  return sides;
}

/// The slope of the line through the trunk's centroids in its slices, each by its cells.
glm::dvec2 OutlineFinder::lean_of_trunk() const {
  constexpr double kShortest_mm = 120;
  const glm::dvec3 cell_mm = geometry_.spacing_mm * glm::dvec3(stride_);
  glm::dvec3 sum(0);
  const auto trunk = std::span(body_cells().all).first(body_cells().trunk);
  const auto place_mm = [&](std::int64_t cell) {
    const std::int64_t row = cell / size_.x;
    return cell_mm * glm::dvec3(Index3(cell % size_.x, row % size_.y, row / size_.y));
  };
  for (const std::int64_t cell : trunk) sum += place_mm(cell);
  const glm::dvec3 middle = sum / static_cast<double>(trunk.size());
  glm::dvec2 products(0);
  double squares = 0, lowest = 0, highest = 0;
  for (const std::int64_t cell : trunk) {
    const glm::dvec3 from = place_mm(cell) - middle;
    products += from.z * glm::dvec2(from);
    squares += from.z * from.z;
    lowest = std::min(lowest, from.z);
    highest = std::max(highest, from.z);
  }
  return highest - lowest >= kShortest_mm ? products / squares : glm::dvec2(0);
}

BodyOutline OutlineFinder::finish() const {
  const glm::dvec3 cell_mm = geometry_.spacing_mm * glm::dvec3(stride_);
  std::vector<std::int64_t> body = body_cells().all;
  const std::size_t trunk = body_cells().trunk;
  const auto position_mm = [&](std::int64_t cell) {
    const glm::dvec2 index(static_cast<double>(cell % size_.x),
                           static_cast<double>(cell / size_.x % size_.y));
    return glm::dvec2(geometry_.origin_mm) + index * glm::dvec2(cell_mm);
  };
  glm::dvec2 sum_mm(0);
  for (std::size_t cell = 0; cell < trunk; ++cell) sum_mm += position_mm(body[cell]);
  BodyOutline outline{.centre_mm = sum_mm / static_cast<double>(trunk),
                      .radius_mm = 0,
                      .lean = lean_of_trunk(),
                      .limbs = body_cells().limbs};
  outline.cut_sides = cut_sides();
  if (options_.keeps_table) {
    body.clear();
    for (std::size_t cell = 0; cell < dense_.size(); ++cell)
      if (dense_[cell]) body.push_back(static_cast<std::int64_t>(cell));
  }
  std::vector<double> distances_mm;
  distances_mm.reserve(body.size());
  for (const std::int64_t cell : body)
    distances_mm.push_back(glm::distance(position_mm(cell), outline.centre_mm));
  const auto most =
      distances_mm.begin() + static_cast<std::ptrdiff_t>(0.99 * static_cast<double>(body.size() - 1));
  std::ranges::nth_element(distances_mm, most);
  // A cell stands for its stride, so matter may reach half a cell's diagonal farther.
  const double reach_mm = 0.5 * glm::length(glm::dvec2(cell_mm));
  outline.radius_mm = *std::max_element(most, distances_mm.end()) + reach_mm;
  outline.radius_99_mm = *most + reach_mm;
  return outline;
}

/// Of every coarse cell: 1 within one cell of the body, 2 at the border of that.
std::vector<std::uint8_t> OutlineFinder::cells_around_body() const {
  if (options_.keeps_table) return std::vector<std::uint8_t>(dense_.size(), 1);
  const auto widened = [&](std::vector<std::uint8_t> cells) {
    for (int axis = 0; axis < 3; ++axis) {
      const std::int64_t stride = axis == 0 ? 1 : axis == 1 ? size_.x : size_.x * size_.y;
      const std::vector<std::uint8_t> before = cells;
      for (std::int64_t cell = 0; cell < static_cast<std::int64_t>(cells.size()); ++cell) {
        const std::int64_t place = cell / stride % size_[axis];
        cells[cell] |= static_cast<std::uint8_t>((place > 0 && before[cell - stride]) ||
                                                 (place + 1 < size_[axis] && before[cell + stride]));
      }
    }
    return cells;
  };
  std::vector<std::uint8_t> inner(dense_.size(), 0);
  for (const std::int64_t cell : body_cells().all) inner[cell] = 1;
  std::vector<std::uint8_t> around = widened(inner);
  for (std::size_t cell = 0; cell < around.size(); ++cell)
    if (around[cell] && !inner[cell]) around[cell] = 2;
  return around;
}

std::uint64_t OutlineFinder::fine_word(std::int64_t word, std::int64_t y, std::int64_t z) const {
  const bool exists =
      word >= 0 && word < fine_words_ && y >= 0 && y < fine_size_.y && z >= 0 && z < fine_size_.z;
  return exists ? fine_[(z * fine_size_.y + y) * fine_words_ + word] : 0;
}

/// The dense voxels of a word with a neighbour that is not.
std::uint64_t OutlineFinder::skin_word(std::int64_t word, std::int64_t y, std::int64_t z) const {
  const std::uint64_t here = fine_word(word, y, z);
  if (here == 0) return 0;
  const std::uint64_t left = here << 1 | fine_word(word - 1, y, z) >> 63,
                      right = here >> 1 | fine_word(word + 1, y, z) << 63;
  return here & ~(left & right & fine_word(word, y - 1, z) & fine_word(word, y + 1, z) &
                  fine_word(word, y, z - 1) & fine_word(word, y, z + 1));
}

std::int64_t OutlineFinder::coarse(std::int64_t fine, int axis) const {
  return std::min((fine * fine_stride_[axis] + stride_[axis] / 2) / stride_[axis], size_[axis] - 1);
}

void OutlineFinder::visit_skin(const std::function<void(const glm::dvec3&)>& visit) const {
  const std::vector<std::uint8_t> around = cells_around_body();
  for (std::int64_t z = 0; z < fine_size_.z; ++z)
    for (std::int64_t y = 0; y < fine_size_.y; ++y) {
      const std::uint8_t* cells = &around[(coarse(z, 2) * size_.y + coarse(y, 1)) * size_.x];
      for (std::int64_t word = 0; word < fine_words_; ++word) {
        const std::uint64_t skin = skin_word(word, y, z);
        for (std::uint64_t left = fine_word(word, y, z); left != 0; left &= left - 1) {
          const std::int64_t x = 64 * word + std::countr_zero(left);
          const std::uint8_t cell = cells[coarse(x, 0)];
          // Beyond the border lies what is no body, such as the table, and may be as dense.
          if (cell == 0 || (cell == 1 && (skin & (left & -left)) == 0)) continue;
          visit(geometry_.to_world_mm(glm::dvec3(Index3(x, y, z) * fine_stride_)));
        }
      }
    }
}

/// The body's voxels of so many slices together, and of the voxels above and below these: rows of words.
std::vector<std::vector<std::uint64_t>> OutlineFinder::shadows(std::int64_t slices) const {
  const std::vector<std::uint8_t> around = cells_around_body();
  const std::int64_t count = (geometry_.size.z + slices - 1) / slices;
  std::vector<std::vector<std::uint64_t>> shadows(
      static_cast<std::size_t>(count),
      std::vector<std::uint64_t>(static_cast<std::size_t>(fine_size_.y * fine_words_), 0));
  std::vector<std::uint64_t> mask(fine_words_);
  for (std::int64_t y = 0; y < fine_size_.y; ++y) {
    std::int64_t masked = -1;  // the coarse slice that `mask` is of
    for (std::int64_t z = 0; z < fine_size_.z; ++z) {
      if (coarse(z, 2) != masked) {
        masked = coarse(z, 2);
        const std::uint8_t* cells = &around[(masked * size_.y + coarse(y, 1)) * size_.x];
        std::ranges::fill(mask, 0);
        for (std::int64_t x = 0; x < fine_size_.x; ++x)
          mask[x / 64] |= std::uint64_t{cells[coarse(x, 0)] != 0} << x % 64;
      }
      const std::int64_t first = std::max<std::int64_t>(0, z - 1) * fine_stride_.z / slices,
                         last = std::min((z + 2) * fine_stride_.z - 1, geometry_.size.z - 1) / slices;
      for (std::int64_t shadow = first; shadow <= last; ++shadow)
        for (std::int64_t word = 0; word < fine_words_; ++word)
          shadows[shadow][y * fine_words_ + word] |= mask[word] & fine_word(word, y, z);
    }
  }
  return shadows;
}

void OutlineFinder::visit_shadow_skins(
    std::int64_t slices, const std::function<void(int shadow, const glm::dvec3& voxel_mm)>& visit) const {
  int index = 0;
  for (const std::vector<std::uint64_t>& shadow : shadows(slices)) {
    const auto at = [&](std::int64_t x, std::int64_t y) {
      return x >= 0 && x < fine_size_.x && y >= 0 && y < fine_size_.y &&
             (shadow[y * fine_words_ + x / 64] >> x % 64 & 1) != 0;
    };
    for (std::int64_t y = 0; y < fine_size_.y; ++y)
      for (std::int64_t x = 0; x < fine_size_.x; ++x)
        if (at(x, y) && !(at(x - 1, y) && at(x + 1, y) && at(x, y - 1) && at(x, y + 1)))
          visit(index, geometry_.to_world_mm(glm::dvec3(Index3(x, y, 0) * fine_stride_)));
    ++index;
  }
}

}  // namespace xraycast
