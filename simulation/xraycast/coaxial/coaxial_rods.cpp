#include "xraycast/coaxial/coaxial_rods.hpp"

#include "xraycast/base/error.hpp"

#include <algorithm>
#include <cmath>

namespace xraycast {
namespace {

// How far one tip is behind or ahead of the other while it passes it.
constexpr double kPassing_mm = 1;
constexpr double kJoulePer_uJ = 1e-6;
// Of the energies in lumens and walls, of up to some hundred millijoule.
constexpr double kRounding_uJ = 1e-10;

// Converged when an iteration decreases the potential by less than the first, five millinewton against 1
// N/mm, and its quadratic model is off by less than the second. What the model is off by is left where the
// rod is stiff, in stretching: nine millinewton against 400 N/mm.
constexpr double kTolerance_uJ = 1e-2, kModelTolerance_uJ = 1e-4;
// Armijo's condition, on the decrease by the quadratic model: less than this share of it, and the step went
// too far, beyond a valley, say.
constexpr double kArmijo = 0.2;
constexpr int kMaxBacktracks = 12;  // halvings, after which an iteration makes no progress

bool has_converged(double model_decrease_uJ, double decrease_uJ) {
  return std::max(model_decrease_uJ, decrease_uJ) < kTolerance_uJ &&
         std::abs(decrease_uJ - model_decrease_uJ) < kModelTolerance_uJ;
}

bool is_low_enough(double reached_uJ, double before_uJ, double scale, double model_decrease_uJ) {
  const double rounding_uJ = 1e-12 * std::abs(before_uJ);
  return reached_uJ <= before_uJ - kArmijo * scale * std::max(0.0, model_decrease_uJ) + rounding_uJ;
}

}  // namespace

void check_fits_inside(const InstrumentModel& outer, const InstrumentModel& inner) {
  if (inner.radius_mm() < outer.inner_radius_mm()) return;
  constexpr const char* kOrder = "list the outermost instrument first";
  if (outer.inner_radius_mm() == 0)
    throw InputError(
        "{}: it has no lumen for {}; {}, and an instrument with an \"inner_radius_mm\" around another",
        outer.name(), inner.name(), kOrder);
  if (outer.radius_mm() < inner.inner_radius_mm())
    throw InputError(
        "{}: its radius of {:.3g} mm does not fit into the lumen of {}, of {:.3g} mm, but the other way "
        "round they fit; {}",
        inner.name(), inner.radius_mm(), outer.name(), outer.inner_radius_mm(), kOrder);
  throw InputError(
      "{}: its radius of {:.3g} mm does not fit into the lumen of {}, of {:.3g} mm; choose a thinner one",
      inner.name(), inner.radius_mm(), outer.name(), outer.inner_radius_mm());
}

CoaxialRods::CoaxialRods(std::vector<Rod> rods) : rods_(std::move(rods)), externals_(rods_.size(), nullptr) {
  for (std::size_t inner = 1; inner < count(); ++inner) {
    check_fit(inner, rods_[inner].instrument());
    for (std::size_t outer = 0; outer < inner; ++outer) couple(outer, inner);
  }
  reserve();
}

void CoaxialRods::reserve() {
  std::size_t nodes = 0;
  for (const Rod& rod : rods_) nodes += rod.max_nodes();
  system_.reserve(nodes);
}

void CoaxialRods::check_fit(std::size_t instrument, const InstrumentModel& model) const {
  for (std::size_t d = 0; d < count(); ++d) {
    if (d < instrument) check_fits_inside(rods_[d].instrument(), model);
    if (d > instrument) check_fits_inside(model, rods_[d].instrument());
  }
}

/// Makes the lumen between them anew.
void CoaxialRods::couple(std::size_t outer, std::size_t inner) {
  const InstrumentModel &around = rods_[outer].instrument(), &within = rods_[inner].instrument();
  const LumenContact lumen(outer, inner,
                           {.lumen_radius_mm = around.inner_radius_mm(),
                            .inner_radius_mm = within.radius_mm(),
                            .static_friction = within.static_friction(),
                            .kinetic_friction = within.kinetic_friction()});
  const double apart_mm = rods_[inner].fed_mm() - rods_[outer].fed_mm();
  const std::size_t index = lumen_index(outer, inner);
  if (index == lumens_.size()) {
    lumens_.push_back(lumen);
    reaches_.push_back({apart_mm, apart_mm});
  } else {
    lumens_[index] = lumen;
    reaches_[index] = {apart_mm, apart_mm};
  }
}

void CoaxialRods::replace(std::size_t instrument, Rod rod) {
  check_fit(instrument, rod.instrument());
  rods_[instrument] = std::move(rod);
  reserve();
  for (std::size_t outer = 0; outer < instrument; ++outer) couple(outer, instrument);
  for (std::size_t inner = instrument + 1; inner < count(); ++inner) couple(instrument, inner);
  is_moved_ = true;
}

void CoaxialRods::rotate_to(std::size_t instrument, double rotation_rad) {
  is_moved_ = is_moved_ || rotation_rad != rods_[instrument].clamp().rotation_rad;
  rods_[instrument].rotate_to(rotation_rad);
}

void CoaxialRods::feed_to(std::size_t instrument, double fed_mm) {
  Rod& rod = rods_[instrument];
  const auto before = static_cast<std::ptrdiff_t>(rod.node_count());
  const double fed_before_mm = rod.fed_mm();
  rod.feed_to(fed_mm, externals_[instrument]);
  is_moved_ = is_moved_ || rod.fed_mm() != fed_before_mm;
  const std::ptrdiff_t by = static_cast<std::ptrdiff_t>(rod.node_count()) - before;
  if (by == 0) return;
  for (LumenContact& lumen : lumens_) {
    if (lumen.outer() == instrument) lumen.outer_nodes_changed(by);
    if (lumen.inner() == instrument) lumen.inner_nodes_changed(by);
  }
}

double CoaxialRods::bare_mm(std::size_t instrument) const {
  double bare_mm = rods_[instrument].fed_mm();
  for (std::size_t outer = 0; outer < instrument; ++outer)
    bare_mm = std::min(bare_mm, std::max(0.0, reaches_[lumen_index(outer, instrument)].beyond_mm));
  return bare_mm;
}

double CoaxialRods::energy_J() const {
  double energy = 0;
  for (const Rod& rod : rods_) energy += rod.elastic_energy_J() + rod.kinetic_energy_J();
  return energy + kJoulePer_uJ * lumens_uJ();
}

double CoaxialRods::lumens_uJ() const {
  double energy = 0;
  for (const LumenContact& lumen : lumens_) energy += lumen.energy_uJ();
  return energy;
}

/// In the lumens and the external potentials.
double CoaxialRods::contacts_uJ() const {
  double energy = lumens_uJ();
  for (const ExternalPotential* external : externals_)
    if (external) energy += external->stored_uJ();
  return energy;
}

// ---- a step begins --------------------------------------------------------------------------------------

/// The inner's length beyond the outer's tip or, negative, the outer's beyond the inner's: along the
/// centreline of the one that is ahead. These differ a little; where the tips pass, the one gives way to the
/// other.
void CoaxialRods::find_reach(std::size_t index) {
  Reach& reach = reaches_[index];
  const Rod &outer = rods_[lumens_[index].outer()], &inner = rods_[lumens_[index].inner()];
  const double apart_mm = inner.fed_mm() - outer.fed_mm();
  const double expected_mm = reach.beyond_mm + apart_mm - reach.fed_apart_mm;
  reach.fed_apart_mm = apart_mm;
  const auto beyond_mm = [](const Rod& rod, double from_mm, const Rod& other) {
    return from_tip_mm(rod,
                       nearest_place(rod.state(), place_of(rod, from_mm), other.state().nodes_mm.back()));
  };
  const bool is_near = std::abs(expected_mm) < 2 * kPassing_mm;
  double ahead_mm = 0, behind_mm = 0, is_ahead = expected_mm > 0 ? 1 : 0;
  if (is_near || is_ahead > 0) ahead_mm = beyond_mm(inner, expected_mm, outer);
  if (is_near || is_ahead == 0) behind_mm = -beyond_mm(outer, -expected_mm, inner);
  if (is_near) {
    const double t = std::clamp(0.5 + 0.25 * (ahead_mm + behind_mm) / kPassing_mm, 0.0, 1.0);
    is_ahead = t * t * (3 - 2 * t);
  }
  reach.beyond_mm = std::lerp(behind_mm, ahead_mm, is_ahead);
  reach.by_rim = share_of_rim(outer, inner, reach.beyond_mm);
}

/// What lies in the lumens and what in the vessel, by the reaches.
void CoaxialRods::begin_contacts() {
  for (std::size_t d = 0; d < count(); ++d)
    if (externals_[d]) externals_[d]->begin_step(rods_[d], d == 0 ? ExternalPotential::kAllBare : bare_mm(d));
  for (std::size_t inner = 1; inner < count(); ++inner) {
    // From the next one around it on: each holds what lies beyond the tips of those before.
    double to_mm = rods_[inner].fed_mm();
    for (std::size_t outer = inner; outer-- > 0;) {
      const std::size_t index = lumen_index(outer, inner);
      const double from_mm = std::clamp(reaches_[index].beyond_mm, 0.0, to_mm);
      lumens_[index].begin_step(rods_, {from_mm, to_mm}, reaches_[index].by_rim);
      to_mm = from_mm;
    }
  }
}

/// And what is gained by that: the points and their lengths move along.
void CoaxialRods::find_overlaps() {
  const double before_uJ = contacts_uJ();
  last_reaches_ = reaches_;
  for (std::size_t k = 0; k < lumens_.size(); ++k) find_reach(k);
  begin_contacts();
  gained_uJ_ = contacts_uJ() - before_uJ;
}

void CoaxialRods::measure_along() {
  along_mm_.resize(count());
  for (std::size_t d = 0; d < count(); ++d) {
    along_mm_[d].resize(rods_[d].node_count());
    double ahead_mm = 0;
    for (std::size_t node = 0; node < along_mm_[d].size(); ++node) {
      const double own_mm = rods_[d].fed_mm() - rods_[d].from_tip_mm(node);
      for (std::size_t outer = 0; outer < d; ++outer) {
        const Rod& around = rods_[outer];
        const auto beside_mm = lumens_[lumen_index(outer, d)].ahead_mm(rods_, node);
        if (!beside_mm) continue;
        // As much as that is ahead itself, about there.
        const auto& beyond =
            std::lower_bound(along_mm_[outer].begin(), along_mm_[outer].end(), own_mm + *beside_mm);
        const auto at =
            std::min<std::ptrdiff_t>(beyond - along_mm_[outer].begin(), std::ssize(along_mm_[outer]) - 1);
        const auto other = static_cast<std::size_t>(at);
        ahead_mm = *beside_mm + along_mm_[outer][other] - (around.fed_mm() - around.from_tip_mm(other));
      }
      along_mm_[d][node] = own_mm + ahead_mm;
    }
  }
}

void CoaxialRods::begin_step(double dt_s) {
  for (Rod& rod : rods_) rod.begin_step(dt_s);
  if (lumens_.empty())
    begin_contacts();
  else
    find_overlaps();
  measure_along();
  system_.order(along_mm_);
}

// ---- a step ---------------------------------------------------------------------------------------------

double CoaxialRods::potential_uJ(double dt_s, bool of_trial) {
  double energy = 0;
  const auto state = [&](std::size_t d) -> const RodState& {
    return of_trial ? rods_[d].trial_ : rods_[d].state_;
  };
  for (std::size_t d = 0; d < count(); ++d) {
    const double own_uJ = rods_[d].potential_uJ(state(d), dt_s);
    energy += externals_[d] ? own_uJ + externals_[d]->energy_uJ(state(d)) : own_uJ;
  }
  for (LumenContact& lumen : lumens_) energy += lumen.energy_uJ(state(lumen.outer()), state(lumen.inner()));
  return energy;
}

void CoaxialRods::accept_trial() {
  for (Rod& rod : rods_) std::swap(rod.state_, rod.trial_);
}

void CoaxialRods::step(double dt_s) {
  begin_step(dt_s);
  // Without input nothing else pays for a gain. The last step tells what this one can release.
  const bool may_gain = !is_moved_ && !lumens_.empty();
  if (may_gain && gained_uJ_ > released_uJ_) keep_overlaps();
  const bool may_repeat = may_gain && gained_uJ_ > kRounding_uJ;
  if (may_repeat) save_start();
  Rod::KineticBalance balance = minimise(dt_s);
  if (may_repeat && balance.allowed_uJ < 0) {
    for (std::size_t d = 0; d < count(); ++d) rods_[d].state_ = starts_[d];
    keep_overlaps();
    balance = minimise(dt_s);
  }
  end_step(dt_s, balance);
}

/// What an inner rod has in a lumen and in the vessel stays as it was in the last step.
void CoaxialRods::keep_overlaps() {
  reaches_ = last_reaches_;
  begin_contacts();
  gained_uJ_ = 0;
}

void CoaxialRods::save_start() {
  starts_.resize(count());
  for (std::size_t d = 0; d < count(); ++d) starts_[d] = rods_[d].state_;
}

/// From where the step begins. What is gained in the contacts is charged on the velocities, as far as they
/// reach.
Rod::KineticBalance CoaxialRods::minimise(double dt_s) {
  const double start_uJ = potential_uJ(dt_s, false);
  // In the contacts, and below by the hubs' rotation.
  double spent_uJ = std::max(0.0, gained_uJ_);
  for (const Rod& rod : rods_) spent_uJ += rod.dissipation_uJ(rod.state_);
  double potential = predict_uJ(dt_s, start_uJ);
  const int most = most_iterations();
  int iterations = 0;
  for (; iterations < most; ++iterations) {
    double model_decrease_uJ = 0;
    if (!solve_newton(dt_s, model_decrease_uJ)) break;  // not finite: the rods stay
    const double before_uJ = potential;
    if (!search_line(dt_s, model_decrease_uJ, potential)) break;
    if (has_converged(model_decrease_uJ, before_uJ - potential)) break;
  }
  is_solved_ = iterations < most;
  released_uJ_ = start_uJ - potential;
  Rod::KineticBalance balance{.allowed_uJ = start_uJ - spent_uJ - potential};
  for (const Rod& rod : rods_) rod.balance_velocities(dt_s, balance);
  return balance;
}

int CoaxialRods::most_iterations() const {
  const Rod::Options& options = rods_[0].options_;
  std::size_t nodes = 0;
  for (const Rod& rod : rods_) nodes += rod.node_count();
  return std::min(options.max_iterations, std::max(1, options.max_node_iterations / static_cast<int>(nodes)));
}

/// The first iterate: where inertia alone leads, if the potential is lower there than at the start. Returns
/// it.
double CoaxialRods::predict_uJ(double dt_s, double start_uJ) {
  for (Rod& rod : rods_) {
    rod.aim_by_inertia(dt_s);
    rod.displace(rod.state_, rod.direction_.data(), 1, rod.trial_);
  }
  if (const double reached_uJ = potential_uJ(dt_s, true); reached_uJ < start_uJ) {
    accept_trial();
    return reached_uJ;
  }
  potential_uJ(dt_s, false);
  return start_uJ;
}

void CoaxialRods::assemble(double dt_s, bool project_psd) {
  for (const LumenContact& lumen : lumens_) lumen.couple(system_);
  system_.reset();
  for (std::size_t d = 0; d < count(); ++d) {
    rods_[d].assemble(dt_s, project_psd, system_.rows(d));
    if (externals_[d]) externals_[d]->assemble(rods_[d].state_, project_psd, system_.rows(d));
  }
  for (const LumenContact& lumen : lumens_)
    lumen.assemble(rods_[lumen.outer()].state_, rods_[lumen.inner()].state_, project_psd, system_);
}

/// Newton's direction or, where the Hessian is indefinite, as it is while a tip snaps, that of its PSD
/// projection, which is a descent direction too. False for numbers that are not finite.
bool CoaxialRods::solve_newton(double dt_s, double& model_decrease_uJ) {
  for (const bool project_psd : {false, true}) {
    assemble(dt_s, project_psd);
    if (!system_.factorise()) continue;
    model_decrease_uJ = system_.solve();
    for (std::size_t d = 0; d < count(); ++d) system_.copy_direction(d, rods_[d].direction_);
    return true;
  }
  return false;
}

/// Backtracks along the direction until Armijo's condition holds. False, and the states as they were, if it
/// never does.
bool CoaxialRods::search_line(double dt_s, double model_decrease_uJ, double& potential) {
  double scale = 1;
  for (const Rod& rod : rods_) scale = std::min(scale, rod.largest_scale());
  for (int backtracks = 0; backtracks < kMaxBacktracks; ++backtracks, scale *= 0.5) {
    for (Rod& rod : rods_) rod.displace(rod.state_, rod.direction_.data(), scale, rod.trial_);
    const double reached_uJ = potential_uJ(dt_s, true);
    if (!is_low_enough(reached_uJ, potential, scale, model_decrease_uJ)) continue;
    accept_trial();
    potential = reached_uJ;
    return true;
  }
  potential_uJ(dt_s, false);
  return false;
}

void CoaxialRods::end_step(double dt_s, const Rod::KineticBalance& balance) {
  for (Rod& rod : rods_) rod.update_velocities(dt_s, balance);
  for (std::size_t d = 0; d < count(); ++d) {
    if (externals_[d]) externals_[d]->end_step(rods_[d].state_);
    rods_[d].update_clamp_reaction();
  }
  for (LumenContact& lumen : lumens_)
    lumen.end_step(rods_[lumen.outer()].state_, rods_[lumen.inner()].state_);
  is_moved_ = false;
}

}  // namespace xraycast
