#include "xraycast/blood_flow/embolisation.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/blood_flow/blood.hpp"
#include "xraycast/blood_flow/rest_flow.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace xraycast {
namespace {

double cubic_mm(double diameter_mm) { return diameter_mm * diameter_mm * diameter_mm; }

/// Of Poiseuille's flow with that stress at the wall.
double arteriole_ml_s(double diameter_mm) {
  constexpr double kStress_Pa = 1.5, kMl_of_mm3 = 1e-3;
  return kMl_of_mm3 * std::numbers::pi / 32 * cubic_mm(diameter_mm) * kStress_Pa / kBloodViscosity_Pa_s;
}

}  // namespace

double Particles::per_ml() const {
  constexpr double kMm3_of_ml = 1000;
  return are_any() ? kVolumeShare * kMm3_of_ml / (std::numbers::pi / 6 * cubic_mm(diameter_mm)) : 0;
}

void check(const Particles& particles) {
  if (!particles.are_valid())
    throw InputError("`particles_mm` {:g}: must be 0, for none, or a diameter of {:g} to {:g} mm",
                     particles.diameter_mm, Particles::kLeast_mm, Particles::kMost_mm);
}

std::string in_words(const Embolised& embolised) {
  constexpr double kPercent = 100;
  if (embolised.branch == Embolised::kElsewhere)
    return fmt::format("{:.0f} particles in {}", embolised.particles, embolised.vessel);
  return fmt::format("{:.0f} particles in {}, whose periphery has {:.0f} % of its conductance left",
                     embolised.particles, embolised.vessel, kPercent * embolised.open_share);
}

Embolisation::Embolisation(const VesselTree& tree, const RestFlow& rest)
    : tree_(tree),
      rest_ml_s_(rest.ml_s),
      is_outlet_(rest.is_outlet),
      particles_(rest.ml_s.size()),
      open_share_(rest.ml_s.size(), 1) {}

void Embolisation::add(double count, double diameter_mm, std::size_t branch, const Flows& flows) {
  const double up = std::max(0.0, -flows.start[branch]), down = std::max(0.0, flows.end[branch]);
  if (up + down <= 0) {
    particles_[branch] += count;
    return;
  }
  const double up_share = up / (up + down);
  if (up_share > 0) leave_start(up_share * count, diameter_mm, branch, flows);
  if (up_share < 1) leave_end((1 - up_share) * count, diameter_mm, branch, flows);
}

/// Through the start of a branch towards the root, and into what leaves the bifurcation there.
void Embolisation::leave_start(double count, double diameter_mm, std::size_t branch, const Flows& flows) {
  if (tree_.branches()[branch].parent < 0)
    elsewhere_ += count;
  else
    leave_end(count, diameter_mm, static_cast<std::size_t>(tree_.branches()[branch].parent), flows);
}

/// From the end of a branch, into what leaves there: the periphery, other branches, or back into the branch.
void Embolisation::leave_end(double count, double diameter_mm, std::size_t branch, const Flows& flows) {
  constexpr double kNone = 1e-6;  // flows that are rounding go in circles
  if (count < kNone) {
    particles_[branch] += count;
    return;
  }
  if (is_outlet_[branch]) {
    const double arterioles = rest_ml_s_[branch] / arteriole_ml_s(diameter_mm);
    particles_[branch] += count;
    open_share_[branch] = std::max(0.0, open_share_[branch] - count / (kPerArteriole * arterioles));
    return;
  }
  const double back = std::max(0.0, -flows.end[branch]);
  double leaving = back;
  const std::vector<int>& children = tree_.branches()[branch].children;
  for (const int child : children) leaving += std::max(0.0, flows.start[static_cast<std::size_t>(child)]);
  if (leaving <= 0) {
    particles_[branch] += count;
    return;
  }
  for (const int child : children) {
    const auto c = static_cast<std::size_t>(child);
    if (flows.start[c] > 0) leave_end(count * flows.start[c] / leaving, diameter_mm, c, flows);
  }
  if (back > 0) leave_start(count * back / leaving, diameter_mm, branch, flows);
}

std::vector<Embolised> Embolisation::list() const {
  std::vector<Embolised> list;
  for (std::size_t b = 0; b < particles_.size(); ++b)
    if (particles_[b] >= 1)
      list.push_back({.branch = static_cast<int>(b),
                      .vessel = tree_.title(static_cast<int>(b)),
                      .particles = particles_[b],
                      .open_share = open_share_[b]});
  if (elsewhere_ >= 1) {
    Embolised elsewhere;
    elsewhere.branch = Embolised::kElsewhere;
    elsewhere.vessel = "other organs";
    elsewhere.particles = elsewhere_;
    list.push_back(std::move(elsewhere));
  }
  return list;
}

std::vector<Embolised> most_first(std::vector<Embolised> embolised, std::size_t most) {
  std::stable_sort(embolised.begin(), embolised.end(),
                   [](const Embolised& a, const Embolised& b) { return a.particles > b.particles; });
  if (embolised.size() <= most) return embolised;
  Embolised others;
  others.branch = Embolised::kElsewhere;
  others.vessel = fmt::format("{} other places", embolised.size() - most);
  for (std::size_t i = most; i < embolised.size(); ++i) others.particles += embolised[i].particles;
  embolised.resize(most);
  embolised.push_back(std::move(others));
  return embolised;
}

}  // namespace xraycast
