#include "xraycast/mechanics/wall_contact.hpp"

#include <Eigen/Eigenvalues>
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
constexpr double kStiffeningStrain = 0.2, kMinStiffening_mm = 0.3, kMaxStiffening_mm = 1;
double squared(double x) { return x * x; }

double stiffening_mm(const LumenDistanceField::Sample& sample) {
  return std::clamp(kStiffeningStrain * sample.radius_mm, kMinStiffening_mm, kMaxStiffening_mm);
}

Eigen::Matrix3d positive_part(const Eigen::Matrix3d& matrix) {
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> parts;
  parts.computeDirect(matrix);
  return parts.eigenvectors() * parts.eigenvalues().cwiseMax(0).asDiagonal() *
         parts.eigenvectors().transpose();
}

// Nodes, of which the clamp holds the first, and the middles between them.
std::size_t contact_count(std::size_t nodes) { return 2 * nodes - 3; }
RodPoint contact_point(std::size_t index, std::size_t nodes) {
  const std::size_t node = 1 + index / 2;
  return index % 2 == 0 ? RodPoint::at_node(node, node + 1 == nodes) : RodPoint::at_middle(node);
}

}  // namespace

WallContact::WallContact(std::shared_ptr<const LumenDistanceField> field, const Rod& rod,
                         const Options& options, const Introducer* introducer)
    : field_(std::move(field)), options_(options), radius_mm_(rod.device().radius_mm()) {
  if (introducer) {
    introducer_ = *introducer;
    has_introducer_ = true;
  }
  contacts_.reserve(contact_count(rod.most_nodes()));
  grips_.reserve(contact_count(rod.most_nodes()));
  contacts_.resize(contact_count(rod.node_count()));
  grips_.resize(contacts_.size());
  for (std::size_t k = 0; k < contacts_.size(); ++k) {
    contacts_[k].point = contact_point(k, rod.node_count());
    const Vector3d place_mm = contacts_[k].point.place_mm(rod.state());
    grips_[k].from = field_->locate(place_mm);
    look(k, place_mm);
    grips_[k].stiffening_mm = stiffening_mm(contacts_[k].sample);
  }
}

double WallContact::wall_force_N(double depth_mm, std::size_t index) const {
  const Grip& grip = grips_[index];
  return options_.stiffness_N_mm2 * grip.share_mm * depth_mm * (1 + squared(depth_mm / grip.stiffening_mm));
}

double WallContact::wall_energy_uJ(double depth_mm, std::size_t index) const {
  const Grip& grip = grips_[index];
  return grip.wall_mN_mm * squared(depth_mm) * (0.5 + 0.25 * squared(depth_mm / grip.stiffening_mm));
}

void WallContact::look(std::size_t index, const Vector3d& point_mm) {
  Contact& contact = contacts_[index];
  contact.sample = field_->at(point_mm, grips_[index].from);
  contact.depth_mm = std::max(0.0, radius_mm_ - contact.sample.clearance_mm);
  grips_[index].looked_at_mm = point_mm;
}

void WallContact::touch(std::size_t index, const Vector3d& point_mm) {
  // Within a vessel the clearance changes by little more than the way, so that a point well within the lumen
  // need not look.
  constexpr double kSteepest = 1.5;
  const double way_mm = (point_mm - grips_[index].looked_at_mm).norm();
  const LumenDistanceField::Sample& sample = contacts_[index].sample;
  if (sample.place.branch == grips_[index].from.branch &&
      sample.clearance_mm - kSteepest * way_mm > radius_mm_)
    contacts_[index].depth_mm = 0;
  else if (way_mm > 0)
    look(index, point_mm);
}

void WallContact::node_added() {
  // The node and the middle behind it.
  contacts_.insert(contacts_.begin(), 2, Contact(contacts_.front()));
  Grip grip;
  grip.from = grips_.front().from;
  grip.stiffening_mm = grips_.front().stiffening_mm;
  grip.looked_at_mm = grips_.front().looked_at_mm;
  grips_.insert(grips_.begin(), 2, grip);
}

void WallContact::node_removed() {
  contacts_.erase(contacts_.begin(), contacts_.begin() + 2);
  grips_.erase(grips_.begin(), grips_.begin() + 2);
}

Vector3d WallContact::aside_mm(const Vector3d& point_mm) const {
  const Vector3d offset = point_mm - introducer_.exit_mm;
  return offset - offset.dot(introducer_.axis) * introducer_.axis;
}

void WallContact::begin_step(const Rod& rod) {
  const RodState& state = rod.state();
  const double introducer_mm =
      has_introducer_ ? (introducer_.exit_mm - rod.clamp().position_mm).dot(introducer_.axis) : 0;
  for (std::size_t k = 0; k < contacts_.size(); ++k) {
    Contact& contact = contacts_[k];
    Grip& grip = grips_[k];
    contact.point = contact_point(k, rod.node_count());
    const std::size_t node = contact.point.edge + 1;
    grip.share_mm =
        0.5 * (k % 2 == 0 ? rod.share_mm(node) : rod.from_tip_mm(node - 1) - rod.from_tip_mm(node));
    if (k == 0) grip.share_mm += 0.25 * (rod.from_tip_mm(0) - rod.from_tip_mm(1));
    grip.wall_mN_mm = options_.stiffness_N_mm2 / kMilli * grip.share_mm;
    grip.spring_mN_mm = options_.tangential_N_mm2 / kMilli * grip.share_mm;
    grip.start_mm = contact.point.place_mm(state);
    // What has been fed through the introducer is no longer in it, even where it turns back beside it.
    const double from_tip_mm = contact.point.first * rod.from_tip_mm(contact.point.edge) +
                               contact.point.last * rod.from_tip_mm(node);
    const double inside = std::clamp((introducer_mm - rod.fed_mm() + from_tip_mm) / kGuideRamp_mm, 0.0, 1.0);
    grip.guide_mN_mm = kGuide_N_mm2 / kMilli * grip.share_mm * inside * inside * (3 - 2 * inside);
    // Where the last step left it, or, so that the rod does not pass from one vessel into another but where
    // they meet, where the point before it is.
    const int looked_from = grip.from.branch;
    grip.from = contact.sample.place;
    if (k > 0 && contacts_[k - 1].sample.place.branch != grip.from.branch)
      grip.from = contacts_[k - 1].sample.place;
    if (grip.from.branch != looked_from)
      look(k, grip.start_mm);
    else
      touch(k, grip.start_mm);
    if (contact.depth_mm == 0) {
      contact.sliding = false;
      grip.held_mm.setZero();
      grip.limit_mN = 0;
      // For as long as the next contact lasts: a wall that changed under a load would make energy.
      grip.stiffening_mm = stiffening_mm(contact.sample);
      continue;
    }
    const double friction = contact.sliding ? options_.kinetic_friction : options_.static_friction;
    grip.limit_mN = friction / kMilli * wall_force_N(contact.depth_mm, k);
    const Vector3d normal = contact.sample.gradient.normalized();
    const Vector3d& tangent = state.edges[contact.point.edge].tangent;
    grip.across = normal.cross(tangent);
    const double sine = grip.across.norm();
    // A tip that pushes straight into a wall, or an axis on the centreline of a vessel that is too narrow:
    // any tangent will do.
    grip.across = sine > 1e-6                ? Vector3d(grip.across / sine)
                  : normal.squaredNorm() > 0 ? normal.unitOrthogonal()
                                             : tangent.unitOrthogonal();
    grip.along = grip.across.cross(normal);
    grip.slip_mm = {grip.held_mm.dot(grip.along), grip.held_mm.dot(grip.across)};
  }
}

Vector2d WallContact::slip_mm(const RodState& state, std::size_t index) const {
  const Grip& grip = grips_[index];
  const RodPoint& point = contacts_[index].point;
  const Vector3d moved = point.place_mm(state) - grip.start_mm;
  return grip.slip_mm +
         Vector2d(moved.dot(grip.along), moved.dot(grip.across) + radius_mm_ * point.spin_rad(state));
}

double WallContact::energy_uJ(const RodState& state) {
  double energy = 0;
  for (std::size_t k = 0; k < contacts_.size(); ++k) {
    Grip& grip = grips_[k];
    const Vector3d place_mm = contacts_[k].point.place_mm(state);
    touch(k, place_mm);
    energy += wall_energy_uJ(contacts_[k].depth_mm, k);
    grip.guide_uJ = grip.guide_mN_mm > 0 ? 0.5 * grip.guide_mN_mm * aside_mm(place_mm).squaredNorm() : 0;
    energy += grip.guide_uJ;
    if (grip.limit_mN == 0) continue;
    const double spring = grip.spring_mN_mm;
    const double slip = slip_mm(state, k).norm();
    energy += spring * slip <= grip.limit_mN
                  ? 0.5 * spring * slip * slip
                  : grip.limit_mN * slip - 0.5 * grip.limit_mN * grip.limit_mN / spring;
  }
  return energy;
}

void WallContact::assemble(const RodState& state, bool convex, RodSystem& system) {
  for (std::size_t k = 0; k < contacts_.size(); ++k) {
    const Contact& contact = contacts_[k];
    const Grip& grip = grips_[k];
    if (contact.depth_mm == 0 && grip.limit_mN == 0 && grip.guide_mN_mm == 0) continue;
    Eigen::Vector4d slope = Eigen::Vector4d::Zero();
    Eigen::Matrix4d hessian = Eigen::Matrix4d::Zero();

    if (grip.guide_mN_mm > 0) {
      slope.head<3>() += grip.guide_mN_mm * aside_mm(contact.point.place_mm(state));
      hessian.topLeftCorner<3, 3>() +=
          grip.guide_mN_mm * (Eigen::Matrix3d::Identity() - introducer_.axis * introducer_.axis.transpose());
    }
    if (contact.depth_mm > 0) {
      const double force_mN = wall_force_N(contact.depth_mm, k) / kMilli;
      const double stiffness = grip.wall_mN_mm * (1 + 3 * squared(contact.depth_mm / grip.stiffening_mm));
      const Vector3d& inward = contact.sample.gradient;
      slope.head<3>() -= force_mN * inward;
      // A wall that goes round turns the force of a point that goes round with it.
      const Eigen::Matrix3d wall =
          stiffness * inward * inward.transpose() + force_mN * contact.sample.curvature();
      hessian.topLeftCorner<3, 3>() += convex ? positive_part(wall) : wall;
    }
    if (grip.limit_mN > 0) {
      const double spring = grip.spring_mN_mm;
      const Vector2d slip = slip_mm(state, k);
      const double length = slip.norm();
      Eigen::Matrix2d stiffness = spring * Eigen::Matrix2d::Identity();
      Vector2d force = spring * slip;
      if (spring * length > grip.limit_mN) {
        const Vector2d direction = slip / length;
        force = grip.limit_mN * direction;
        stiffness =
            grip.limit_mN / length * (Eigen::Matrix2d::Identity() - direction * direction.transpose());
      }
      Eigen::Matrix<double, 2, 4> by;
      by << grip.along.transpose(), 0, grip.across.transpose(), radius_mm_;
      slope += by.transpose() * force;
      hessian += by.transpose() * stiffness * by;
    }
    system.add(contact.point, slope, hessian);
  }
}

void WallContact::end_step(const RodState& state) {
  look(contacts_.size() - 1, state.nodes_mm.back());  // where the tip is, is asked for
  for (std::size_t k = 0; k < contacts_.size(); ++k) {
    Contact& contact = contacts_[k];
    Grip& grip = grips_[k];
    contact.normal_N = wall_force_N(contact.depth_mm, k) * contact.sample.gradient;
    contact.guide_N = -kMilli * grip.guide_mN_mm * aside_mm(contact.point.place_mm(state));
    contact.friction_N.setZero();
    grip.held_mm.setZero();
    if (grip.limit_mN == 0) continue;

    const double spring = grip.spring_mN_mm;
    Vector2d slip = slip_mm(state, k);
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
    grip.held_mm = slip[0] * grip.along + slip[1] * grip.across;
  }
}

double WallContact::energy_J() const {
  double energy = 0;
  for (std::size_t k = 0; k < contacts_.size(); ++k) {
    const Grip& grip = grips_[k];
    energy += wall_energy_uJ(contacts_[k].depth_mm, k) + grip.guide_uJ +
              0.5 * grip.spring_mN_mm * grip.held_mm.squaredNorm();
  }
  return kMicro * energy;
}

}  // namespace xraycast
