#include "xraycast/catheter/catheter.hpp"

#include "xraycast/catheter/introducer.hpp"
#include "xraycast/mechanics/vectors.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace xraycast {
namespace {

using Eigen::Vector3d;

const VesselEnd& checked(const VesselTree& tree, const VesselEnd& entry, const InstrumentModel& instrument) {
  check_fits(tree, entry, instrument);
  return entry;
}

}  // namespace

double node_spacing_mm(const VesselTree& tree, const InstrumentModel& instrument) {
  constexpr double kMinSpacing_mm = 1.5, kMaxSpacing_mm = 5;
  double min_radius_mm = kMaxSpacing_mm;
  for (const VesselBranch& branch : tree.branches())
    for (const VesselPoint& point : branch.points)
      if (point.radius_mm > instrument.radius_mm()) min_radius_mm = std::min(min_radius_mm, point.radius_mm);
  return std::clamp(1.5 * min_radius_mm, kMinSpacing_mm, kMaxSpacing_mm);
}

Catheter::Catheter(const VesselTree& tree, const InstrumentModel& instrument, const VesselEnd& entry,
                   const Options& options)
    : options_(options),
      rod_(instrument,
           instrument.stations_mm(options.spacing_mm > 0 ? options.spacing_mm
                                                         : node_spacing_mm(tree, instrument)),
           clamp_at(checked(tree, entry, instrument)), kIntroducer_mm,
           {.max_iterations = options.max_iterations, .max_node_iterations = options.max_node_iterations}),
      wall_(
          walls_around(lumen_with_introducer(tree, entry), rod_, entry, options.wall_stiffness_N_mm2, true)) {
  // The rest shape of its tip relaxes in the introducer and just outside it.
  for (int i = 0; i < 200; ++i) rod_.step(0.01, wall_.get());
}

double Catheter::max_insertion_mm() const { return xraycast::max_insertion_mm(rod_.instrument()); }

void Catheter::step(const HubPose& target) {
  const double rotation_before_rad = hub_.pose.rotation_rad;
  hub_.approach(target, load().force_N, max_insertion_mm(), options_.step_s,
                {kMaxSpeed_mm_s, kMaxSpeed_rad_s, kMaxPush_N});
  if (hub_.pose.rotation_rad != rotation_before_rad) rod_.rotate_to(hub_.pose.rotation_rad);
  rod_.feed_to(kIntroducer_mm + hub_.pose.insertion_mm, wall_.get());
  rod_.step(options_.step_s, wall_.get());
  ++steps_;
}

HubLoad Catheter::load() const {
  return {.force_N = -rod_.clamp_force_N().dot(rod_.clamp().axis), .torque_Nm = -rod_.clamp_torque_Nm()};
}

CatheterTip Catheter::tip() const {
  const LumenDistanceField::Sample& sample = wall_->contacts().back().sample;
  return {.position_mm = to_glm(rod_.state().nodes_mm.back()),
          .direction = to_glm(rod_.state().edges.back().tangent),
          .branch = sample.hint.branch,
          .arc_length_mm = sample.arc_length_mm};
}

void Catheter::copy_nodes(std::vector<glm::dvec3>& nodes_mm) const {
  nodes_mm.clear();
  for (const Vector3d& node : rod_.state().nodes_mm) nodes_mm.push_back(to_glm(node));
}

void Catheter::copy_contacts(std::vector<CatheterContact>& contacts) const {
  contacts.clear();
  for (const WallContact::Contact& contact : wall_->contacts())
    if (contact.depth_mm > 0)
      contacts.push_back(
          {to_glm(contact.point.position_mm(rod_.state())), to_glm(contact.normal_N + contact.friction_N)});
}

double Catheter::energy_J() const {
  return rod_.elastic_energy_J() + rod_.kinetic_energy_J() + wall_->energy_J();
}

NurbsCurve curve_through(const std::vector<glm::dvec3>& nodes_mm) {
  // The parameter at which each control point has most weight: its Greville abscissa, the mean of its three
  // inner knots.
  const NurbsCurve first = NurbsCurve::cubic(nodes_mm, "catheter");
  std::vector<double> greville;
  for (std::size_t i = 0; i < nodes_mm.size(); ++i)
    greville.push_back((first.knots()[i + 1] + first.knots()[i + 2] + first.knots()[i + 3]) / 3);
  std::vector<glm::dvec3> controls = nodes_mm;
  // Each iteration leaves a third of the distance or less.
  constexpr int kIterations = 8;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    const NurbsCurve curve = NurbsCurve::cubic(controls, "catheter");
    for (std::size_t i = 0; i < controls.size(); ++i) controls[i] += nodes_mm[i] - curve.at_mm(greville[i]);
  }
  return NurbsCurve::cubic(controls, "catheter");
}

}  // namespace xraycast
