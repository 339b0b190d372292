#include "xraycast/mask/thinning.hpp"

#include <array>
#include <bit>
#include <cstdlib>
#include <vector>

namespace xraycast {
namespace {

constexpr std::uint32_t kFaces = 0x3f, kFacesAndEdges = 0x3ffff;

/// For each neighbour, which of the others are at most `reach` steps from it along each axis and at most
/// `steps` in all.
std::array<std::uint32_t, 26> adjacency(std::int64_t steps) {
  std::array<std::uint32_t, 26> result{};
  for (std::size_t i = 0; i < 26; ++i)
    for (std::size_t k = 0; k < 26; ++k) {
      const Index3 d = kNeighbours[i] - kNeighbours[k];
      const std::int64_t x = std::abs(d.x), y = std::abs(d.y), z = std::abs(d.z);
      if (i != k && x <= 1 && y <= 1 && z <= 1 && x + y + z <= steps) result[i] |= 1u << k;
    }
  return result;
}

/// All of `set` that is connected to the voxels of `from`.
std::uint32_t flood(std::uint32_t from, std::uint32_t set, const std::array<std::uint32_t, 26>& adjacent) {
  std::uint32_t reached = from, fresh = from;
  while (fresh != 0) {
    std::uint32_t next = 0;
    for (std::uint32_t bits = fresh; bits != 0; bits &= bits - 1)
      next |= adjacent[static_cast<std::size_t>(std::countr_zero(bits))];
    fresh = next & set & ~reached;
    reached |= fresh;
  }
  return reached;
}

/// Whether a voxel can be deleted without changing the topology of an object (a simple point): in its
/// neighbourhood the object has one 26-connected component and the background one 6-connected component
/// (Bertrand and Malandain, A new characterization of three-dimensional simple points, 1994). Bit i of
/// `neighbourhood` is neighbour i of kNeighbours.
bool is_simple(std::uint32_t neighbourhood) {
  static const std::array<std::uint32_t, 26> touching = adjacency(3), sharing_a_face = adjacency(1);
  const std::uint32_t outside_faces = ~neighbourhood & kFaces;
  if (neighbourhood == 0 || outside_faces == 0) return false;
  const std::uint32_t first = neighbourhood & (~neighbourhood + 1);
  if (flood(first, neighbourhood, touching) != neighbourhood) return false;
  const std::uint32_t first_face = outside_faces & (~outside_faces + 1);
  const std::uint32_t reached = flood(first_face, ~neighbourhood & kFacesAndEdges, sharing_a_face);
  return (reached & outside_faces) == outside_faces;
}

/// Works on a copy padded with a layer of background, so that no neighbour needs a bounds check.
class Thinning {
 public:
  Thinning(const Mask& mask, StraightLines straight)
      : size_(mask.geometry.size + Index3(2)), straight_(straight) {
    inside_.resize(static_cast<std::size_t>(size_.x * size_.y * size_.z));
    for (std::size_t i = 0; i < 26; ++i) steps_[i] = offset(kNeighbours[i]);
    const Index3 size = mask.geometry.size;
    for (std::int64_t z = 0; z < size.z; ++z)
      for (std::int64_t y = 0; y < size.y; ++y)
        for (std::int64_t x = 0; x < size.x; ++x)
          if (mask[{x, y, z}] != 0) {
            const std::int64_t at = offset({x + 1, y + 1, z + 1});
            inside_[static_cast<std::size_t>(at)] = 1;
            remaining_.push_back(at);
          }
  }

  void run(Progress& progress) {
    progress.begin("thinning", static_cast<std::int64_t>(remaining_.size()), "voxels");
    for (bool changed = true; changed;) {
      changed = false;
      for (std::size_t direction = 0; direction < 6; ++direction) {
        const std::int64_t deleted = delete_border_voxels(direction);
        changed |= deleted > 0;
        progress.advance(deleted);
      }
      std::erase_if(remaining_, [&](std::int64_t at) { return inside_[static_cast<std::size_t>(at)] == 0; });
    }
  }

  void store(Mask& mask) const {
    for (const std::int64_t at : remaining_) {
      const std::int64_t slice = size_.x * size_.y;
      mask[{at % size_.x - 1, at % slice / size_.x - 1, at / slice - 1}] = 1;
    }
  }

 private:
  std::int64_t offset(const Index3& i) const { return (i.z * size_.y + i.y) * size_.x + i.x; }

  std::uint32_t neighbourhood(std::int64_t at) const {
    std::uint32_t bits = 0;
    for (std::size_t i = 0; i < 26; ++i)
      bits |= static_cast<std::uint32_t>(inside_[static_cast<std::size_t>(at + steps_[i])]) << i;
    return bits;
  }

  /// Whether a voxel is no end of a line.
  static bool is_deletable(std::uint32_t bits) { return std::popcount(bits) > 1 && is_simple(bits); }

  /// Deletes the simple points on the border of one direction; all candidates are found before the first is
  /// deleted. A candidate that has lost neighbours since and is the end of a line now, one or two voxels
  /// wide, stays: the whole length of a straight line two voxels wide lies on the border across it, and would
  /// be deleted from one end to the other. Returns how many were deleted.
  std::int64_t delete_border_voxels(std::size_t direction) {
    check_cancelled();
    candidates_.clear();
    for (const std::int64_t at : remaining_)
      if (inside_[static_cast<std::size_t>(at)] != 0 &&
          inside_[static_cast<std::size_t>(at + steps_[direction])] == 0)
        if (const std::uint32_t bits = neighbourhood(at); is_deletable(bits))
          candidates_.push_back({at, bits});
    std::int64_t deleted = 0;
    for (const auto& [at, bits_before] : candidates_) {
      const std::uint32_t bits = neighbourhood(at);
      if (!is_deletable(bits) ||
          (straight_ == StraightLines::keep && bits != bits_before && std::popcount(bits) <= 2))
        continue;
      inside_[static_cast<std::size_t>(at)] = 0;
      ++deleted;
    }
    return deleted;
  }

  Index3 size_;
  StraightLines straight_;
  std::array<std::int64_t, 26> steps_{};
  std::vector<std::uint8_t> inside_;
  std::vector<std::int64_t> remaining_;
  struct Candidate {
    std::int64_t at;
    std::uint32_t bits;  ///< its neighbourhood before any was deleted
  };
  std::vector<Candidate> candidates_;
};

}  // namespace

Mask thin(const Mask& mask, Progress& progress, StraightLines straight) {
  Thinning thinning(mask, straight);
  thinning.run(progress);
  Mask lines(mask.geometry);
  thinning.store(lines);
  return lines;
}

}  // namespace xraycast
