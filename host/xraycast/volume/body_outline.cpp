#include "xraycast/volume/body_outline.hpp"

#include "xraycast/base/error.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>

namespace xraycast {
namespace {

constexpr std::int16_t kBodyHu = -300;
constexpr double kGrid_mm = 3;
constexpr double kOpening_mm = 5;  // to each side

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

/// The cells of the largest 6-connected component. Visited cells of `dense` become 0.
std::vector<std::int64_t> largest_component(std::vector<std::uint8_t>& dense, const Index3& size) {
  std::vector<std::int64_t> largest, current;
  const std::int64_t slice = size.x * size.y;
  for (std::int64_t seed = 0; seed < static_cast<std::int64_t>(dense.size()); ++seed) {
    if (!dense[seed]) continue;
    current.assign(1, seed);
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
    if (current.size() > largest.size()) largest.swap(current);
  }
  return largest;
}

std::int64_t stride_for(double spacing_mm) {
  return std::max<std::int64_t>(1, std::llround(kGrid_mm / spacing_mm));
}

std::int64_t reach_for(double cell_mm) {
  return std::max<std::int64_t>(0, std::llround(kOpening_mm / cell_mm));
}

}  // namespace

OutlineFinder::OutlineFinder(const VolumeGeometry& geometry)
    : geometry_(geometry),
      stride_(stride_for(geometry.spacing_mm.x), stride_for(geometry.spacing_mm.y),
              stride_for(geometry.spacing_mm.z)),
      size_((geometry.size + stride_ - Index3(1)) / stride_) {
  dense_.reserve(static_cast<std::size_t>(size_.x * size_.y * size_.z));
}

void OutlineFinder::add(std::span<const std::int16_t> hu) {
  const std::int64_t slice = geometry_.slice_voxels(), count = static_cast<std::int64_t>(hu.size()) / slice;
  for (std::int64_t z = 0; z < count; ++z, ++slices_seen_) {
    if (slices_seen_ % stride_.z != 0) continue;
    for (std::int64_t y = 0; y < geometry_.size.y; y += stride_.y)
      for (std::int64_t x = 0; x < geometry_.size.x; x += stride_.x)
        dense_.push_back(hu[z * slice + y * geometry_.size.x + x] > kBodyHu);
  }
}

BodyOutline OutlineFinder::finish() const {
  const glm::dvec3 cell_mm = geometry_.spacing_mm * glm::dvec3(stride_);
  std::vector<std::uint8_t> opened = dense_;
  for (std::size_t first = 0; first < opened.size(); first += static_cast<std::size_t>(size_.x * size_.y))
    open_slice(opened.data() + first, size_, reach_for(cell_mm.x), reach_for(cell_mm.y));
  std::vector<std::int64_t> body = largest_component(opened, size_);
  if (body.empty()) {  // a body thinner than the opening, such as a phantom in air
    opened = dense_;
    body = largest_component(opened, size_);
  }
  if (body.empty())
    throw InputError("nothing in the scan lies above {} HU, so no body was found; give a centre and a radius",
                     kBodyHu);

  const auto position_mm = [&](std::int64_t cell) {
    const glm::dvec2 index(static_cast<double>(cell % size_.x),
                           static_cast<double>(cell / size_.x % size_.y));
    return glm::dvec2(geometry_.origin_mm) + index * glm::dvec2(cell_mm);
  };
  glm::dvec2 sum_mm(0);
  for (const std::int64_t cell : body) sum_mm += position_mm(cell);
  BodyOutline outline{sum_mm / static_cast<double>(body.size()), 0};
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

BodyOutline find_outline(const Volume& volume) {
  OutlineFinder finder(volume.geometry());
  finder.add(volume.hu());
  return finder.finish();
}

}  // namespace xraycast
