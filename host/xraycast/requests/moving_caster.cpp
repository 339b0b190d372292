#include "xraycast/requests/moving_caster.hpp"

#include "xraycast/base/parallel.hpp"
#include "xraycast/casting/device_field.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <utility>

namespace xraycast {
namespace {

// ---- displacements at the keys -------------------------------------------------------------------------

/// Visits the keys in order, with the displacement of each node. The displacements of a mode are looked up
/// once at the places to which the modes before it lead.
class KeyDisplacements {
 public:
  using Visit = std::function<void(int key, std::span<const glm::vec3> displacement_mm)>;

  KeyDisplacements(const Motion& motion, const KeyPhases& phases, const FieldNodes& nodes, Visit visit)
      : motion_(motion), phases_(phases), visit_(std::move(visit)) {
    rest_mm_.reserve(static_cast<std::size_t>(nodes.count()));
    for (Index3 node(0); node.z < nodes.size.z; ++node.z)
      for (node.y = 0; node.y < nodes.size.y; ++node.y)
        for (node.x = 0; node.x < nodes.size.x; ++node.x) rest_mm_.push_back(nodes.place_mm(node));
  }

  void visit() { visit_modes(0, 0, rest_mm_); }

 private:
  static constexpr std::int64_t kRun = 4096;  // of nodes, a thread's

  template <typename Work>
  void for_runs(const Work& work) const {
    const std::int64_t count = std::ssize(rest_mm_);
    parallel_for((count + kRun - 1) / kRun,
                 [&](std::int64_t run) { work(run * kRun, std::min(kRun, count - run * kRun)); });
  }

  void visit_modes(std::size_t mode, int key, const std::vector<glm::dvec3>& places_mm) {
    if (mode == motion_.modes().size()) {
      std::vector<glm::vec3> displacement_mm(places_mm.size());
      for_runs([&](std::int64_t first, std::int64_t count) {
        for (std::int64_t i = first; i < first + count; ++i)
          displacement_mm[i] = glm::vec3(places_mm[i] - rest_mm_[i]);
      });
      return visit_(key, displacement_mm);
    }
    const MotionMode& moving = motion_.modes()[mode];
    std::map<const Displacement*, std::vector<glm::dvec3>> sampled_mm;
    for (const KeyPhase& of_motion : moving.keys)
      if (of_motion.moves) sampled_mm[of_motion.moves.get()].resize(places_mm.size());
    for (auto& sampled : sampled_mm)
      for_runs([&](std::int64_t first, std::int64_t count) {
        sampled.first->add(std::span(places_mm).subspan(first, count), 1,
                           std::span(sampled.second).subspan(first, count));
      });
    const std::vector<double>& phases = phases_.phases()[mode];
    for (std::size_t i = 0; i < phases.size(); ++i) {
      const std::vector<double> weights = moving.weights_at(phases[i]);
      std::vector<glm::dvec3> next_mm = places_mm;
      for (std::size_t k = 0; k < weights.size(); ++k) {
        if (weights[k] == 0 || !moving.keys[k].moves) continue;
        const std::vector<glm::dvec3>& d_mm = sampled_mm[moving.keys[k].moves.get()];
        for_runs([&](std::int64_t first, std::int64_t count) {
          for (std::int64_t n = first; n < first + count; ++n) next_mm[n] += weights[k] * d_mm[n];
        });
      }
      visit_modes(mode + 1, key * static_cast<int>(phases.size()) + static_cast<int>(i), next_mm);
    }
  }

  const Motion& motion_;
  const KeyPhases& phases_;
  Visit visit_;
  std::vector<glm::dvec3> rest_mm_;
};

/// The slices [first, end) in which two displacements differ; none where they do so nowhere.
std::optional<std::pair<std::int64_t, std::int64_t>> moved_slices_of(const FieldNodes& nodes,
                                                                     std::span<const glm::vec3> a,
                                                                     std::span<const glm::vec3> b) {
  const std::int64_t of_level = nodes.size.x * nodes.size.y;
  std::vector<std::uint8_t> differs(static_cast<std::size_t>(nodes.size.z), 0);
  parallel_for(nodes.size.z, [&](std::int64_t level) {
    for (std::int64_t i = level * of_level; i < (level + 1) * of_level; ++i)
      if (glm::length(a[i] - b[i]) > kSameDisplacement_mm) {
        differs[level] = 1;
        return;
      }
  });
  const auto lowest = std::ranges::find(differs, 1) - differs.begin();
  if (lowest == std::ssize(differs)) return {};
  const auto highest = differs.rend() - std::find(differs.rbegin(), differs.rend(), 1) - 1;
  const auto step = static_cast<std::int64_t>(nodes.step.z);
  // Up to the levels beside them, at which the displacement is the same.
  return {{std::max<std::int64_t>(0, (lowest - 1) * step + 1),
           std::min<std::int64_t>(nodes.scan.size.z, (highest + 1) * step)}};
}

/// The rows of a map that its key has of its own: of a cylinder whole bricks; of a sphere all, or none.
KeyRows rows_of_slices(const MapGeometry& geometry, std::int64_t first, std::int64_t end, int base) {
  if (geometry.ray_layout != RayLayout::cylinder) return {base, 0, geometry.height};
  constexpr std::int64_t kBrick = XRC_BRICK_SLICES;
  const std::int64_t lowest = first / kBrick * kBrick,
                     highest = std::min<std::int64_t>(geometry.height, (end + kBrick - 1) / kBrick * kBrick);
  return {base, static_cast<int>(geometry.height - highest), static_cast<int>(highest - lowest)};
}

/// Visits the keys with the rows that they have of their own and the displacement on the device, which has
/// none where the key has no rows.
void visit_keys(const ResidentScan& scan, const MapGeometry& geometry, const Motion& motion,
                const KeyPhases& phases,
                const std::function<void(const KeyRows& rows, const DeviceField& field)>& visit) {
  const FieldNodes nodes(scan.geometry(), kFieldSpacing_mm);
  std::map<int, std::vector<glm::vec3>> bases;  // displacements of keys on which others build
  KeyDisplacements displacements(motion, phases, nodes, [&](int key, std::span<const glm::vec3> d_mm) {
    const int base = phases.base_of(key);
    KeyRows rows{base, 0, geometry.height};
    if (base >= 0) {
      const auto moved = moved_slices_of(nodes, d_mm, bases.at(base));
      rows = moved ? rows_of_slices(geometry, moved->first, moved->second, base) : KeyRows{base, 0, 0};
    }
    // Keys that build on this one have a later mode at another phase than 0.
    if (key + 1 < phases.count() && phases.base_of(key + 1) == key)
      bases[key].assign(d_mm.begin(), d_mm.end());
    visit(rows, DeviceField(scan.device(), nodes, d_mm));
  });
  displacements.visit();
}

}  // namespace

std::vector<glm::dvec3> moved_skin_mm(const OutlineFinder& finder, const VolumeGeometry& scan,
                                      const Motion& motion, const KeyPhases& phases) {
  constexpr double kCoarse_mm = 12, kMoves_mm = 0.5;
  constexpr int kEvery = 3;
  std::vector<glm::dvec3> skin_mm;
  int seen = 0;
  finder.visit_skin([&](const glm::dvec3& voxel_mm) {
    if (seen++ % kEvery == 0) skin_mm.push_back(voxel_mm);
  });
  const FieldNodes nodes(scan, kCoarse_mm);
  std::vector<glm::dvec3> moved_mm;
  const auto at = [&](std::span<const glm::vec3> d_mm, const glm::dvec3& place_mm) {
    const glm::dvec3 node =
        glm::clamp(scan.to_index(place_mm) / nodes.step, glm::dvec3(0), glm::dvec3(nodes.size) - 1.0);
    const Index3 first = glm::min(Index3(node), nodes.size - Index3(2));
    const glm::vec3 share = glm::vec3(node - glm::dvec3(first));
    const glm::vec3* corner = &d_mm[(first.z * nodes.size.y + first.y) * nodes.size.x + first.x];
    const auto along_x = [&](std::int64_t y, std::int64_t z) {
      const glm::vec3* here = corner + (z * nodes.size.y + y) * nodes.size.x;
      return glm::mix(here[0], here[1], share.x);
    };
    return glm::dvec3(glm::mix(glm::mix(along_x(0, 0), along_x(1, 0), share.y),
                               glm::mix(along_x(0, 1), along_x(1, 1), share.y), share.z));
  };
  KeyDisplacements displacements(motion, phases, nodes, [&](int key, std::span<const glm::vec3> d_mm) {
    if (key == 0) return;
    std::vector<glm::dvec3> here_mm(skin_mm.size());
    parallel_for((std::ssize(skin_mm) + 4095) / 4096, [&](std::int64_t run) {
      for (std::int64_t i = run * 4096; i < std::min<std::int64_t>((run + 1) * 4096, std::ssize(skin_mm));
           ++i) {
        // x with x + d(x) = y, by fixed points.
        constexpr int kSteps = 3;
        here_mm[i] = skin_mm[i];
        for (int step = 0; step < kSteps; ++step) here_mm[i] = skin_mm[i] - at(d_mm, here_mm[i]);
      }
    });
    for (std::size_t i = 0; i < skin_mm.size(); ++i)
      if (glm::distance(here_mm[i], skin_mm[i]) > kMoves_mm) moved_mm.push_back(here_mm[i]);
  });
  displacements.visit();
  return moved_mm;
}

CastResult cast_keys(const SpectralScan& scan, const MapGeometry& geometry, const Attenuation& attenuation,
                     const Motion& motion, const KeyPhases& phases, Progress& progress) {
  std::vector<KeyValues> keys;
  CastResult result{{geometry, attenuation, {}, {}}};
  progress.begin("casting", phases.count(), "maps");
  visit_keys(scan.native, geometry, motion, phases, [&](const KeyRows& rows, const DeviceField& field) {
    KeyValues& key = keys.emplace_back(KeyValues{rows, {}});
    if (rows.count == 0) {
      key.channels.resize(keys.front().channels.size());
      return progress.advance();
    }
    const MovedRows moved{field, rows.first, rows.count};
    Progress one;  // the keys are counted here
    const CastResult cast_key = cast(scan, geometry, attenuation, one, &moved);
    result.kernel_ms += cast_key.kernel_ms;
    if (cast_key.map.spectrum())
      for (const std::vector<float>& depths : cast_key.map.depths)
        key.channels.push_back(own_rows(depths, geometry, rows));
    else
      key.channels.push_back(own_rows(cast_key.map.tau, geometry, rows));
    progress.advance();
  });
  auto maps = std::make_shared<KeyMaps>(phases, geometry, keys);
  maps->motion = motion.name();
  result.map = moving_map(std::move(result.map), std::move(maps));
  return result;
}

Basis make_key_basis(const ResidentScan& scan, const MapGeometry& geometry, std::vector<double> knots_hu,
                     const Motion& motion, const KeyPhases& phases, Progress& progress) {
  std::optional<Basis> basis;
  auto keys = std::make_shared<BasisKeys>(BasisKeys{phases, motion.name(), {}});
  progress.begin("weighing", phases.count(), "maps");
  visit_keys(scan, geometry, motion, phases, [&](const KeyRows& rows, const DeviceField& field) {
    if (rows.count == 0) {
      keys->others.push_back({rows, {}, {}});
      return progress.advance();
    }
    const MovedRows moved{field, rows.first, rows.count};
    Progress one;  // the keys are counted here
    Basis of_key = make_basis(scan, geometry, knots_hu, one, &moved);
    if (!basis)
      basis = std::move(of_key);
    else
      keys->others.push_back({rows, std::move(of_key.touched), std::move(of_key.weights)});
    progress.advance();
  });
  basis->keys = std::move(keys);
  return std::move(*basis);
}

}  // namespace xraycast
