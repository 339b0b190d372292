#include "xraycast/viewer/contrast_surface.hpp"

#include <numbers>
#include <numeric>
#include <span>

namespace xraycast {
namespace {

constexpr std::uint32_t kSides = 12;

/// Puts a ring's outline and its centre into the surface, all with one share; the index of the first.
std::uint32_t add_ring(const Ring& ring, float share, Surface& surface) {
  const auto first = static_cast<std::uint32_t>(surface.mesh.points_mm.size());
  for (std::uint32_t i = 0; i < kSides; ++i)
    surface.mesh.points_mm.emplace_back(ring.at_mm(2 * std::numbers::pi * i / kSides));
  surface.mesh.points_mm.emplace_back(ring.centre_mm);
  surface.shares.resize(surface.mesh.points_mm.size(), share);
  return first;
}

/// Looks along the line where it `faces_on`, else back.
void add_disc(const Ring& ring, float share, bool faces_on, Surface& surface) {
  const std::uint32_t first = add_ring(ring, share, surface), centre = first + kSides;
  for (std::uint32_t i = 0; i < kSides; ++i) {
    const std::uint32_t next = (i + 1) % kSides;
    surface.mesh.triangles.push_back({centre, first + (faces_on ? i : next), first + (faces_on ? next : i)});
  }
}

void add_wall(const Ring& from, const Ring& to, float share, Surface& surface) {
  const std::uint32_t below = add_ring(from, share, surface), above = add_ring(to, share, surface);
  for (std::uint32_t i = 0; i < kSides; ++i) {
    const std::uint32_t next = (i + 1) % kSides;
    surface.mesh.triangles.push_back({below + i, below + next, above + next});
    surface.mesh.triangles.push_back({below + i, above + next, above + i});
  }
}

/// The first stretches of drums, and the end of the last one.
std::vector<std::size_t> divide(const std::vector<double>& arc_length_mm, double drum_mm) {
  std::vector<std::size_t> bounds{0};
  for (std::size_t i = 1; i + 1 < arc_length_mm.size(); ++i)
    if (arc_length_mm[i] - arc_length_mm[bounds.back()] >= drum_mm) bounds.push_back(i);
  bounds.push_back(arc_length_mm.size() - 1);
  return bounds;
}

}  // namespace

ContrastSurface::ContrastSurface(const VesselTree& tree, double drum_mm) {
  for (std::size_t b = 0; b < tree.branches().size(); ++b) {
    const VesselBranch& branch = tree.branches()[b];
    const std::vector<Ring> rings = rings_along(branch.points);
    const std::vector<std::size_t> bounds = divide(branch.arc_length_mm, drum_mm);
    for (std::size_t d = 0; d + 1 < bounds.size(); ++d)
      drums_.push_back(
          {static_cast<int>(b), bounds[d], bounds[d + 1], rings[bounds[d]], rings[bounds[d + 1]], d > 0});
  }
}

Surface ContrastSurface::filled(const std::vector<std::vector<double>>& iodine_mg_ml,
                                double mu_per_mm) const {
  const auto share_of = [&](const Drum& drum) {
    const std::span stretches = std::span(iodine_mg_ml[static_cast<std::size_t>(drum.branch)])
                                    .subspan(drum.first, drum.last - drum.first);
    return static_cast<float>(std::accumulate(stretches.begin(), stretches.end(), 0.0) /
                              static_cast<double>(stretches.size()));
  };
  constexpr float kNothing_mg_ml = 0.01f;
  Surface surface;
  surface.mu_per_mm = mu_per_mm;
  float before = 0;
  for (std::size_t d = 0; d < drums_.size(); ++d) {
    const Drum& drum = drums_[d];
    const float share = share_of(drum) > kNothing_mg_ml ? share_of(drum) : 0;
    if (!drum.follows) before = 0;
    if (share != before) add_disc(drum.from, share - before, false, surface);
    if (share > 0) add_wall(drum.from, drum.to, share, surface);
    const bool ends = d + 1 == drums_.size() || !drums_[d + 1].follows;
    if (ends && share > 0) add_disc(drum.to, share, true, surface);
    before = share;
  }
  return surface;
}

}  // namespace xraycast
