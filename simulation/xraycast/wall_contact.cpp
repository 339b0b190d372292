#include "xraycast/wall_contact.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace xraycast {
namespace {

using Eigen::Vector2d, Eigen::Vector3d;

constexpr double kMilli = 1e-3, kMicro = 1e-6;

// An introducer is a tube of hard plastic; its hold comes in over its last millimetres.
constexpr double kGuide_N_mm2 = 20, kGuideRamp_mm = 5;

// Where a wall bears twice what it would as at first: a fifth of its radius, as far as that is a wall's
// strain.
constexpr double kStiffeningStrain = 0.2, kLeastStiffening_mm = 0.3, kMostStiffening_mm = 1;
double squared(double x) { return x * x; }

}  // namespace

WallContact::WallContact(std::shared_ptr<const TubeField> field, const Rod& rod, const Options& options,
                         const Introducer* introducer)
    : field_(std::move(field)), options_(options), radius_mm_(rod.device().radius_mm()) {
  if (introducer) {
    introducer_ = *introducer;
    has_introducer_ = true;
  }
  const std::size_t most = rod.most_nodes();
  contacts_.reserve(most);
  grips_.reserve(most);
  slips_mm_.reserve(most);
  contacts_.resize(rod.node_count());
  grips_.resize(rod.node_count());
  slips_mm_.assign(rod.node_count(), Vector3d::Zero());
  for (std::size_t i = 0; i < contacts_.size(); ++i) {
    contacts_[i].sample.place = field_->locate(rod.state().nodes_mm[i]);
    look(i, rod.state().nodes_mm[i]);
  }
}

double WallContact::wall_force_N(double depth_mm, std::size_t node) const {
  const Grip& grip = grips_[node];
  return options_.stiffness_N_mm2 * grip.share_mm * depth_mm * (1 + squared(depth_mm / grip.stiffening_mm));
}

double WallContact::wall_energy_uJ(double depth_mm, std::size_t node) const {
  const Grip& grip = grips_[node];
  return options_.stiffness_N_mm2 / kMilli * grip.share_mm * squared(depth_mm) *
         (0.5 + 0.25 * squared(depth_mm / grip.stiffening_mm));
}

void WallContact::look(std::size_t node, const Vector3d& point_mm) {
  Contact& contact = contacts_[node];
  contact.sample = field_->at(point_mm, contact.sample.place);
  contact.depth_mm = std::max(0.0, radius_mm_ - contact.sample.clearance_mm);
  grips_[node].looked_at_mm = point_mm;
}

void WallContact::touch(std::size_t node, const Vector3d& point_mm) {
  // The clearance changes by little more than the way, so that a node well within the lumen need not look.
  constexpr double kSteepest = 1.5;
  const double way_mm = (point_mm - grips_[node].looked_at_mm).norm();
  if (contacts_[node].sample.clearance_mm - kSteepest * way_mm > radius_mm_)
    contacts_[node].depth_mm = 0;
  else if (way_mm > 0)
    look(node, point_mm);
}

void WallContact::node_added() {
  Contact contact;
  contact.sample = contacts_[1].sample;
  contacts_.insert(contacts_.begin() + 1, contact);
  grips_.insert(grips_.begin() + 1, Grip{});
  slips_mm_.insert(slips_mm_.begin() + 1, Vector3d::Zero());
}

void WallContact::node_removed() {
  contacts_.erase(contacts_.begin() + 1);
  grips_.erase(grips_.begin() + 1);
  slips_mm_.erase(slips_mm_.begin() + 1);
}

WallContact::Guide WallContact::guide(const Vector3d& point_mm, std::size_t node) const {
  Guide guide;
  if (!grips_[node].is_guided) return guide;
  const Vector3d offset = point_mm - introducer_.exit_mm;
  const double inside_mm = -offset.dot(introducer_.axis);  // of the introducer
  if (inside_mm <= 0) return guide;
  const double t = std::min(1.0, inside_mm / kGuideRamp_mm);
  const double hold = kGuide_N_mm2 / kMilli * grips_[node].share_mm;
  const Vector3d aside = offset + inside_mm * introducer_.axis;
  guide.weight = hold * t * t * (3 - 2 * t);
  guide.energy_uJ = 0.5 * guide.weight * aside.squaredNorm();
  guide.slope_mN = guide.weight * aside -
                   0.5 * hold * 6 * t * (1 - t) / kGuideRamp_mm * aside.squaredNorm() * introducer_.axis;
  return guide;
}

void WallContact::begin_step(const Rod& rod) {
  const RodState& state = rod.state();
  bool is_guided = has_introducer_;
  for (std::size_t i = 1; i < contacts_.size(); ++i) {
    Contact& contact = contacts_[i];
    Grip& grip = grips_[i];
    grip.share_mm = rod.share_mm(i);
    grip.start_mm = state.nodes_mm[i];
    // Up to the first node that has left it: a tip that curls back beside the introducer is not in it.
    grip.is_guided = is_guided;
    is_guided = is_guided && (grip.start_mm - introducer_.exit_mm).dot(introducer_.axis) < 0;
    touch(i, grip.start_mm);
    const double radius_mm = contact.sample.clearance_mm + contact.sample.from_centre_mm;
    if (contact.depth_mm == 0 || radius_mm < grip.vessel_radius_mm - 0.1 || grip.vessel_radius_mm == 0) {
      grip.vessel_radius_mm = radius_mm;
      grip.stiffening_mm = std::clamp(kStiffeningStrain * radius_mm, kLeastStiffening_mm, kMostStiffening_mm);
    }
    if (contact.depth_mm == 0) {
      contact.sliding = false;
      slips_mm_[i].setZero();
      grip.limit_mN = 0;
      continue;
    }
    const double friction = contact.sliding ? options_.kinetic_friction : options_.static_friction;
    grip.limit_mN = friction / kMilli * wall_force_N(contact.depth_mm, i);
    const Vector3d normal = contact.sample.gradient.normalized();
    const Vector3d tangent = state.edges[i - 1].tangent;
    grip.across = normal.cross(tangent);
    const double sine = grip.across.norm();
    // A tip that pushes straight into a wall: any tangent will do.
    grip.across = sine > 1e-6 ? Vector3d(grip.across / sine) : normal.unitOrthogonal();
    grip.along = grip.across.cross(normal);
    grip.slip_mm = {slips_mm_[i].dot(grip.along), slips_mm_[i].dot(grip.across)};
  }
}

Vector2d WallContact::slip_mm(const RodState& state, std::size_t node) const {
  const Grip& grip = grips_[node];
  const Vector3d moved = state.nodes_mm[node] - grip.start_mm;
  double spin = spin_share(node) * state.edge_spins_rad[node - 1];
  if (node + 1 < contacts_.size()) spin += 0.5 * state.edge_spins_rad[node];
  return grip.slip_mm + Vector2d(moved.dot(grip.along), moved.dot(grip.across) + radius_mm_ * spin);
}

double WallContact::energy_uJ(const RodState& state) {
  double energy = 0;
  for (std::size_t i = 1; i < contacts_.size(); ++i) {
    Grip& grip = grips_[i];
    touch(i, state.nodes_mm[i]);
    energy += wall_energy_uJ(contacts_[i].depth_mm, i);
    grip.guide_uJ = guide(state.nodes_mm[i], i).energy_uJ;
    energy += grip.guide_uJ;
    if (grip.limit_mN == 0) continue;
    const double spring = options_.tangential_N_mm2 / kMilli * grip.share_mm;
    const double slip = slip_mm(state, i).norm();
    energy += spring * slip <= grip.limit_mN
                  ? 0.5 * spring * slip * slip
                  : grip.limit_mN * slip - 0.5 * grip.limit_mN * grip.limit_mN / spring;
  }
  return energy;
}

void WallContact::assemble(const RodState& state, RodSystem& system) {
  for (std::size_t i = 1; i < contacts_.size(); ++i) {
    const Contact& contact = contacts_[i];
    const Grip& grip = grips_[i];
    const Guide hold = guide(state.nodes_mm[i], i);
    if (contact.depth_mm == 0 && grip.limit_mN == 0 && hold.weight == 0) continue;
    RodSystem::BlockVector slope = RodSystem::BlockVector::Zero();
    RodSystem::Block hessian = RodSystem::Block::Zero();

    if (hold.weight > 0) {
      slope.segment<3>(1) += hold.slope_mN;
      hessian.block<3, 3>(1, 1) +=
          hold.weight * (Eigen::Matrix3d::Identity() - introducer_.axis * introducer_.axis.transpose());
    }
    if (contact.depth_mm > 0) {
      const double force_mN = wall_force_N(contact.depth_mm, i) / kMilli;
      const double stiffness = options_.stiffness_N_mm2 / kMilli * grip.share_mm *
                               (1 + 3 * squared(contact.depth_mm / grip.stiffening_mm));
      const Vector3d& inward = contact.sample.gradient;
      slope.segment<3>(1) -= force_mN * inward;
      hessian.block<3, 3>(1, 1) += stiffness * inward * inward.transpose();
      // A wall that goes round turns the force of a node that goes round with it.
      const double around = force_mN / std::max(contact.sample.from_centre_mm, 0.1 * radius_mm_);
      const Vector3d across = inward.cross(state.edges[i - 1].tangent);
      hessian.block<3, 3>(1, 1) += around * across * across.transpose();
    }
    if (grip.limit_mN > 0) {
      const double spring = options_.tangential_N_mm2 / kMilli * grip.share_mm;
      const Vector2d slip = slip_mm(state, i);
      const double length = slip.norm();
      Eigen::Matrix2d stiffness = spring * Eigen::Matrix2d::Identity();
      Vector2d force = spring * slip;
      if (spring * length > grip.limit_mN) {
        const Vector2d direction = slip / length;
        force = grip.limit_mN * direction;
        stiffness =
            grip.limit_mN / length * (Eigen::Matrix2d::Identity() - direction * direction.transpose());
      }
      Eigen::Matrix<double, 2, 5> by;
      const double behind = i + 1 < contacts_.size() ? 0.5 * radius_mm_ : 0;
      by << 0, grip.along.transpose(), 0, spin_share(i) * radius_mm_, grip.across.transpose(), behind;
      slope += by.transpose() * force;
      hessian += by.transpose() * stiffness * by;
    }
    system.add_around_node(i, slope, hessian);
  }
}

void WallContact::end_step(const RodState& state) {
  look(contacts_.size() - 1, state.nodes_mm.back());  // where the tip is, is asked for
  for (std::size_t i = 1; i < contacts_.size(); ++i) {
    Contact& contact = contacts_[i];
    const Grip& grip = grips_[i];
    contact.normal_N = wall_force_N(contact.depth_mm, i) * contact.sample.gradient;
    contact.guide_N = -kMilli * guide(state.nodes_mm[i], i).slope_mN;
    contact.friction_N.setZero();
    slips_mm_[i].setZero();
    if (grip.limit_mN == 0) continue;

    const double spring = options_.tangential_N_mm2 / kMilli * grip.share_mm;
    Vector2d slip = slip_mm(state, i);
    const double length = slip.norm();
    Vector2d force = spring * slip;
    const bool slides = spring * length > grip.limit_mN;
    if (slides) {
      force = grip.limit_mN * slip / length;
      // Once it slides, less holds it.
      const double kept = contact.sliding || options_.static_friction == 0
                              ? 1
                              : options_.kinetic_friction / options_.static_friction;
      slip *= kept * grip.limit_mN / (spring * length);
    }
    contact.sliding = slides;
    contact.friction_N = -kMilli * (force[0] * grip.along + force[1] * grip.across);
    slips_mm_[i] = slip[0] * grip.along + slip[1] * grip.across;
  }
}

double WallContact::energy_J() const {
  double energy = 0;
  for (std::size_t i = 1; i < contacts_.size(); ++i) {
    const double share_mm = grips_[i].share_mm;
    energy += wall_energy_uJ(contacts_[i].depth_mm, i) +
              0.5 * options_.tangential_N_mm2 / kMilli * share_mm * slips_mm_[i].squaredNorm();
    energy += grips_[i].guide_uJ;
  }
  return kMicro * energy;
}

}  // namespace xraycast
