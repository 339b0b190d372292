#include "xraycast/scene/contrast_surface.hpp"

#include "xraycast/catheter/aneurysm_sac.hpp"
#include "xraycast/geometry/tube.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>
#include <optional>
#include <span>

namespace xraycast {
namespace {

constexpr std::uint32_t kRingSides = 12;
constexpr std::size_t kEndDrums = 2;

/// Puts a ring's outline and its centre, the last, into a mesh; the index of the first.
std::uint32_t add_ring(const Ring& ring, Mesh& mesh) {
  const auto first = static_cast<std::uint32_t>(mesh.points_mm.size());
  for (std::uint32_t i = 0; i < kRingSides; ++i)
    mesh.points_mm.emplace_back(ring.at_mm(2 * std::numbers::pi * i / kRingSides));
  mesh.points_mm.emplace_back(ring.centre_mm);
  return first;
}

void add_drum(const Ring& from, const Ring& to, Mesh& mesh) {
  const std::uint32_t below = add_ring(from, mesh), above = add_ring(to, mesh);
  for (std::uint32_t i = 0; i < kRingSides; ++i) {
    const std::uint32_t next = (i + 1) % kRingSides;
    mesh.triangles.push_back({below + kRingSides, below + next, below + i});
    mesh.triangles.push_back({below + i, below + next, above + next});
    mesh.triangles.push_back({below + i, above + next, above + i});
    mesh.triangles.push_back({above + kRingSides, above + i, above + next});
  }
}

/// As many points along the axis of a sac as its branch has, with the ball's own radii, where the branch has
/// those of spheres.
std::vector<VesselPoint> points_of(const AneurysmSac& sac, std::size_t count) {
  constexpr double kDome = 0.99;  // of the radius, where the last ring is still one
  std::vector<VesselPoint> points;
  for (std::size_t i = 0; i < count; ++i) {
    const double along_mm = std::lerp(-sac.neck_mm, kDome * sac.radius_mm,
                                      static_cast<double>(i) / static_cast<double>(count - 1));
    const double square = sac.radius_mm * sac.radius_mm - along_mm * along_mm;
    points.push_back({sac.centre_mm + along_mm * sac.outwards,
                      std::max(std::sqrt(std::max(0.0, square)), (1 - kDome) * sac.radius_mm)});
  }
  return points;
}

/// As the branch of a tree that leaves another one: its first point has the other one's radius.
std::vector<VesselPoint> own_points(const VesselBranch& branch) {
  std::vector<VesselPoint> points = branch.points;
  if (branch.parent >= 0) points.front().radius_mm = std::min(points[0].radius_mm, points[1].radius_mm);
  return points;
}

/// A round end beyond the last cross-section, in drums: vessels go on there, or into one another.
std::array<Ring, kEndDrums + 1> round_end(const Ring& last, const VesselPoint& before) {
  constexpr std::array<double, kEndDrums + 1> kHeights{0, 0.6, 0.97};  // of the radius
  const glm::dvec3 outwards = glm::normalize(last.centre_mm - before.position_mm);
  std::array<Ring, kEndDrums + 1> rings;
  for (std::size_t i = 0; i < rings.size(); ++i) {
    rings[i] = last;
    rings[i].centre_mm += kHeights[i] * last.radius_mm * outwards;
    rings[i].radius_mm *= std::sqrt(1 - kHeights[i] * kHeights[i]);
  }
  return rings;
}

/// The first stretches of drums of a length or a little more, and the end of the last one.
std::vector<std::size_t> divide(const std::vector<double>& arc_length_mm, double drum_mm) {
  std::vector<std::size_t> bounds{0};
  for (std::size_t i = 1; i + 1 < arc_length_mm.size(); ++i)
    if (arc_length_mm[i] - arc_length_mm[bounds.back()] >= drum_mm) bounds.push_back(i);
  bounds.push_back(arc_length_mm.size() - 1);
  return bounds;
}

}  // namespace

ContrastSurface::ContrastSurface(const VesselTree& tree, double mu_per_mm) : mu_per_mm_(mu_per_mm) {
  for (std::size_t b = 0; b < tree.branches().size(); ++b) {
    const VesselBranch& branch = tree.branches()[b];
    constexpr double kDrum_mm = 2, kOfSac = 0.2;
    const std::optional<AneurysmSac> sac = sac_of(tree, static_cast<int>(b));
    const std::vector<Ring> rings =
        rings_across_chords(sac ? points_of(*sac, branch.points.size()) : own_points(branch));
    const std::vector<std::size_t> bounds =
        divide(branch.arc_length_mm, sac ? std::min(kDrum_mm, kOfSac * sac->radius_mm) : kDrum_mm);
    for (std::size_t d = 0; d + 1 < bounds.size(); ++d) {
      drums_.push_back({static_cast<int>(b), bounds[d], bounds[d + 1]});
      add_drum(rings[bounds[d]], rings[bounds[d + 1]], whole_);
    }
    if (sac) continue;
    const std::array<Ring, kEndDrums + 1> end = round_end(rings.back(), branch.points.end()[-2]);
    for (std::size_t d = 0; d < kEndDrums; ++d) {
      drums_.push_back({static_cast<int>(b), bounds.end()[-2], bounds.back()});
      add_drum(end[d], end[d + 1], whole_);
    }
  }
}

std::vector<float> ContrastSurface::drums_mg_ml(const std::vector<std::vector<double>>& iodine_mg_ml) const {
  std::vector<float> mg_ml;
  for (const Drum& drum : drums_) {
    const std::span stretches = std::span(iodine_mg_ml[static_cast<std::size_t>(drum.branch)])
                                    .subspan(drum.first, drum.last - drum.first);
    mg_ml.push_back(static_cast<float>(std::accumulate(stretches.begin(), stretches.end(), 0.0) /
                                       static_cast<double>(stretches.size())));
  }
  return mg_ml;
}

Surface ContrastSurface::filled(const std::vector<std::vector<double>>& iodine_mg_ml) const {
  return filled(iodine_mg_ml, whole_.points_mm);
}

Surface ContrastSurface::filled(const std::vector<std::vector<double>>& iodine_mg_ml,
                                std::span<const glm::vec3> points_mm) const {
  static_assert(kDrumPoints == 2 * (kRingSides + 1) && kDrumTriangles == 4 * kRingSides);
  const std::vector<float> mg_ml = drums_mg_ml(iodine_mg_ml);
  Surface surface;
  surface.mu_per_mm = mu_per_mm_;
  Mesh& mesh = surface.mesh;
  for (std::size_t d = 0; d < drums_.size(); ++d) {
    if (mg_ml[d] <= kNothing_mg_ml) continue;
    const auto shift = static_cast<std::uint32_t>(d * kDrumPoints - mesh.points_mm.size());
    const std::span drum = points_mm.subspan(d * kDrumPoints, kDrumPoints);
    mesh.points_mm.insert(mesh.points_mm.end(), drum.begin(), drum.end());
    for (const auto& [a, b, c] : std::span(whole_.triangles).subspan(d * kDrumTriangles, kDrumTriangles))
      mesh.triangles.push_back({a - shift, b - shift, c - shift});
    surface.mu_weights.resize(mesh.points_mm.size(), mg_ml[d]);
  }
  return surface;
}

std::vector<glm::vec3> ContrastSurface::drums_moved_mm(std::span<const glm::vec3> points_mm) const {
  std::vector<glm::vec3> moved_mm(drums_.size(), glm::vec3(0));
  for (std::size_t p = 0; p < points_mm.size(); ++p)
    moved_mm[p / kDrumPoints] += (points_mm[p] - whole_.points_mm[p]) / static_cast<float>(kDrumPoints);
  return moved_mm;
}

std::vector<glm::vec2> ContrastSurface::radii_mm() const {
  std::vector<glm::vec2> radii(drums_.size());
  const auto radius_mm = [&](std::size_t first) {
    return glm::distance(whole_.points_mm[first], whole_.points_mm[first + kRingSides]);
  };
  for (std::size_t d = 0; d < drums_.size(); ++d)
    radii[d] = {radius_mm(d * kDrumPoints), radius_mm(d * kDrumPoints + kRingSides + 1)};
  return radii;
}

Surface ContrastSurface::whole() const {
  Surface surface;
  surface.mesh = whole_;
  surface.mu_per_mm = mu_per_mm_;
  return surface;
}

}  // namespace xraycast
