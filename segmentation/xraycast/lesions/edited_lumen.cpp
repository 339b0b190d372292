#include "xraycast/lesions/edited_lumen.hpp"

#include "xraycast/base/parallel.hpp"
#include "xraycast/mask/trilinear.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace xraycast {
namespace {

constexpr int kPlacesAcross = 4;  ///< places along an edge of a voxel

std::array<glm::dvec3, kPlacesAcross * kPlacesAcross * kPlacesAcross> places_in_voxel() {
  std::array<glm::dvec3, kPlacesAcross * kPlacesAcross * kPlacesAcross> places{};
  for (int i = 0; i < static_cast<int>(places.size()); ++i)
    places[static_cast<std::size_t>(i)] = (glm::dvec3(i % kPlacesAcross, i / kPlacesAcross % kPlacesAcross,
                                                      i / (kPlacesAcross * kPlacesAcross)) +
                                           0.5) /
                                              double{kPlacesAcross} -
                                          0.5;
  return places;
}

/// What was in the voxel in which a point lies: full or not, and how full.
struct Content {
  double mask = 0, fill = 0;
  bool operator==(const Content&) const = default;
  Content operator+(const Content& b) const { return {mask + b.mask, fill + b.fill}; }
};

Content content_at(const VoxelLumen& lumen, const glm::dvec3& point_mm) {
  const Index3 voxel(glm::round(lumen.mask.geometry.to_index(point_mm)));
  if (!lumen.mask.contains(voxel)) return {};
  const std::size_t at = lumen.mask.offset(voxel);
  return {static_cast<double>(lumen.mask.voxels[at]), static_cast<double>(lumen.fill.fractions[at])};
}

/// The box's voxels, a voxel beyond it on all sides.
Box voxels_of(const VolumeGeometry& grid, const BoxMm& box_mm) {
  return {glm::max(Index3(glm::floor(grid.to_index(box_mm.first))) - Index3(1), Index3(0)),
          glm::min(Index3(glm::ceil(grid.to_index(box_mm.second))) + Index3(2), grid.size)};
}

/// Whether a point is in the lumen, by the fractions between voxels.
bool is_lumen(const VoxelLumen& lumen, const glm::dvec3& point_mm) {
  const VolumeGeometry& grid = lumen.mask.geometry;
  const glm::dvec3 index =
      glm::clamp(grid.to_index(point_mm), glm::dvec3(0), glm::dvec3(grid.size - Index3(1)));
  const Index3 low(glm::floor(index));
  return 2 * trilinear(lumen.mask, lumen.fill.fractions, low, index - glm::dvec3(low)) >= LumenFill::kFull;
}

constexpr Content kLumen{1, LumenFill::kFull};

Content content_of(const LumenSource& source, const Content& own, const VoxelLumen& lumen) {
  using Kind = LumenSource::Kind;
  return source.kind == Kind::same    ? own
         : source.kind == Kind::full  ? kLumen
         : source.kind == Kind::empty ? Content{}
                                      : content_at(lumen, source.from_mm);
}

/// Asks for all that a voxel may become: its middle and its corners, then the places in it unless these tell
/// enough.
template <typename Source>
class VoxelQuestion {
 public:
  VoxelQuestion(const VoxelLumen& lumen, const Index3& voxel, const Source& source)
      : lumen_(lumen), voxel_(voxel), source_(source), own_(content_at(lumen, at({0, 0, 0}))) {}

  /// The same content all over the voxel, where no throat can hide between the corners.
  std::optional<Content> even_content() const {
    const LumenSource middle = source_(at({0, 0, 0}));
    const Content content = content_of(middle, own_, lumen_);
    const double half_diagonal_mm = 0.5 * glm::length(lumen_.mask.geometry.spacing_mm);
    if (middle.kind == LumenSource::Kind::same && middle.out_mm > half_diagonal_mm) return own_;
    if (content != kLumen && content != Content{}) return {};
    if (content != kLumen && middle.out_mm < half_diagonal_mm) return {};
    for (int corner = 0; corner < 8; ++corner) {
      const glm::dvec3 place = glm::dvec3(corner & 1, corner >> 1 & 1, corner >> 2) - 0.5;
      const LumenSource source = source_(at(0.999 * place));
      if (source.kind == LumenSource::Kind::full || content_of(source, own_, lumen_) != content) return {};
    }
    return content;
  }

  /// What it holds afterwards; nothing where it stays as it is.
  template <typename Places>
  std::optional<Content> changed_content(const Places& places) const {
    using Kind = LumenSource::Kind;
    Content sum;
    bool is_same = true, has_new = false;
    for (const glm::dvec3& place : places) {
      const LumenSource from = source_(at(place));
      is_same = is_same && from.kind == Kind::same;
      has_new = has_new || from.kind == Kind::full;
      sum = sum + content_of(from, own_, lumen_);
    }
    if (is_same) return {};
    const auto count = static_cast<double>(places.size());
    if (has_new) return joined_content(places);
    return Content{sum.mask / count, sum.fill / count};
  }

 private:
  /// New lumen joins what a voxel at the wall holds already: on which side of the wall, the neighbours tell.
  template <typename Places>
  Content joined_content(const Places& places) const {
    double share = 0;
    for (const glm::dvec3& place : places)
      if (source_(at(place)).kind == LumenSource::Kind::full || is_lumen(lumen_, at(place))) share += 1;
    share /= static_cast<double>(places.size());
    return {std::max(own_.mask, share), std::max(own_.fill, share * LumenFill::kFull)};
  }

  glm::dvec3 at(const glm::dvec3& place) const {
    return lumen_.mask.geometry.to_world_mm(glm::dvec3(voxel_) + place);
  }

  const VoxelLumen& lumen_;
  Index3 voxel_;
  const Source& source_;
  Content own_;
};

}  // namespace

std::vector<Box> changing_blocks(const VolumeGeometry& grid, const Box& box, const AskSource& source) {
  constexpr std::int64_t kAcross = 8;
  const Index3 blocks = (box.upper - box.lower + Index3(kAcross - 1)) / Index3(kAcross);
  std::vector<std::vector<Box>> layers(static_cast<std::size_t>(blocks.z));
  parallel_for(blocks.z, [&](std::int64_t z) {
    for (std::int64_t y = 0; y < blocks.y; ++y)
      for (std::int64_t x = 0; x < blocks.x; ++x) {
        const Index3 lower = box.lower + Index3(kAcross) * Index3(x, y, z);
        const Box block{lower, glm::min(lower + Index3(kAcross), box.upper)};
        const glm::dvec3 across(block.upper - block.lower);
        const LumenSource middle = source(grid.to_world_mm(glm::dvec3(lower) + 0.5 * (across - 1.0)));
        const double half_diagonal_mm = 0.5 * glm::length(grid.spacing_mm * across);
        if (middle.kind != LumenSource::Kind::same || middle.out_mm <= half_diagonal_mm)
          layers[static_cast<std::size_t>(z)].push_back(block);
      }
  });
  std::vector<Box> changing;
  for (const std::vector<Box>& layer : layers) changing.insert(changing.end(), layer.begin(), layer.end());
  return changing;
}

void change_lumen(VoxelLumen& lumen, const BoxMm& box_mm, const AskSource& source, Progress& progress) {
  const VolumeGeometry& grid = lumen.mask.geometry;
  const Box box = voxels_of(grid, box_mm);
  if (box.empty()) return;
  struct Changed {
    std::size_t at;
    std::uint8_t mask, fill;
  };
  const std::vector<Box> blocks = changing_blocks(grid, box, source);
  std::vector<std::vector<Changed>> all_changed(blocks.size());
  progress.begin("editing the mask", std::ssize(blocks), "blocks");
  const auto places = places_in_voxel();
  parallel_for(std::ssize(blocks), [&](std::int64_t b) {
    for_each_voxel_of(blocks[static_cast<std::size_t>(b)], [&](const Index3& voxel) {
      const VoxelQuestion question(lumen, voxel, source);
      const std::optional<Content> even = question.even_content(),
                                   content = even ? even : question.changed_content(places);
      const std::size_t at = lumen.mask.offset(voxel);
      if (!content) return;
      const Changed changed{at, content->mask >= 0.5 ? std::uint8_t{1} : std::uint8_t{0},
                            static_cast<std::uint8_t>(std::lround(content->fill))};
      if (changed.mask != lumen.mask.voxels[at] || changed.fill != lumen.fill.fractions[at])
        all_changed[static_cast<std::size_t>(b)].push_back(changed);
    });
    progress.advance();
  });
  for (const auto& in_block : all_changed)
    for (const Changed& changed : in_block) {
      lumen.mask.voxels[changed.at] = changed.mask;
      lumen.fill.fractions[changed.at] = changed.fill;
    }
}

}  // namespace xraycast
