#include "xraycast/mechanics/catheter.hpp"

#include "xraycast/base/error.hpp"

#include <glm/geometric.hpp>

#include <Eigen/Geometry>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <functional>

namespace xraycast {
namespace {

using Eigen::Vector3d;

constexpr double kIntroducer_mm = 20;

glm::dvec3 to_glm(const Vector3d& v) { return {v.x(), v.y(), v.z()}; }

Rod::Clamp clamp_at(const VesselEnd& entry) {
  const Vector3d axis = -entry.outward;
  return {.position_mm = entry.position_mm + kIntroducer_mm * entry.outward,
          .axis = axis,
          .director = axis.unitOrthogonal()};
}

std::unique_ptr<WallContact> walls(const VesselTree& tree, const Rod& rod, const VesselEnd& entry,
                                   double stiffness_N_mm2) {
  // The vessel goes on around the introducer and a little further.
  constexpr double kOpening_mm = kIntroducer_mm + 10;
  const InstrumentModel& device = rod.device();
  const WallContact::Introducer introducer{entry.position_mm, -entry.outward};
  return std::make_unique<WallContact>(std::make_shared<LumenDistanceField>(tree, &entry, kOpening_mm), rod,
                                       WallContact::Options{.stiffness_N_mm2 = stiffness_N_mm2,
                                                            .tangential_N_mm2 = stiffness_N_mm2,
                                                            .static_friction = device.static_friction(),
                                                            .kinetic_friction = device.kinetic_friction()},
                                       &introducer);
}

/// The ends that a device fits into, the widest first.
std::vector<VesselEnd> ends_for(const VesselTree& tree, const InstrumentModel& device) {
  std::vector<VesselEnd> ends = vessel_ends(tree);
  std::erase_if(ends, [&](const VesselEnd& end) { return end.radius_mm <= device.radius_mm(); });
  std::ranges::stable_sort(ends, std::ranges::greater{}, &VesselEnd::radius_mm);
  return ends;
}

const VesselEnd& most_inferior(const std::vector<VesselEnd>& ends) {
  return *std::ranges::min_element(ends, {}, [](const VesselEnd& end) { return end.position_mm.z(); });
}

const VesselEnd& checked(const VesselTree& tree, const VesselEnd& entry, const InstrumentModel& device) {
  if (entry.radius_mm > device.radius_mm()) return entry;
  constexpr std::size_t kMaxNamed = 3;
  std::string wide_enough;
  std::vector<VesselEnd> ends = ends_for(tree, device);
  if (ends.size() > kMaxNamed) ends.resize(kMaxNamed);
  for (const VesselEnd& end : ends)
    wide_enough +=
        fmt::format("{}{:.0f},{:.0f},{:.0f} (branch {}, {:.2g} mm)", wide_enough.empty() ? "" : " or ",
                    end.position_mm.x(), end.position_mm.y(), end.position_mm.z(), end.branch, end.radius_mm);
  throw InputError(
      "{}: its radius of {:.3g} mm does not fit into branch {}, which has {:.3g} mm at its end; {}",
      device.name(), device.radius_mm(), entry.branch, entry.radius_mm,
      wide_enough.empty() ? "nor into any other: take a thinner device"
                          : "take another --entry, such as " + wide_enough);
}

}  // namespace

VesselEnd most_inferior_end(const VesselTree& tree) { return most_inferior(vessel_ends(tree)); }

VesselEnd end_of_branch(const VesselTree& tree, int branch, const std::string& name) {
  if (branch < 0 || branch >= static_cast<int>(tree.branches().size()))
    throw InputError("{}: there is no branch {}; the tree has 0 to {}", name, branch,
                     tree.branches().size() - 1);
  for (const VesselEnd& end : vessel_ends(tree))
    if (end.branch == branch) return end;
  throw InputError("{}: branch {} goes on into others at both ends; a device enters at a vessel's end", name,
                   branch);
}

VesselEnd nearest_end(const VesselTree& tree, const glm::dvec3& point_mm) {
  const std::vector<VesselEnd> ends = vessel_ends(tree);
  return *std::ranges::min_element(
      ends, {}, [&](const VesselEnd& end) { return glm::distance(to_glm(end.position_mm), point_mm); });
}

VesselEnd parse_entry(const VesselTree& tree, const std::string& text, const InstrumentModel& device) {
  if (text.empty()) {
    const std::vector<VesselEnd> ends = ends_for(tree, device);
    return ends.empty() ? most_inferior_end(tree) : most_inferior(ends);
  }
  const std::string name = fmt::format("--entry {}", text);
  std::vector<double> numbers(1);
  const char *at = text.data(), *end = at + text.size();
  while (true) {
    const auto [behind, error] = std::from_chars(at, end, numbers.back());
    const bool goes_on = behind != end && *behind == ',';
    if (error != std::errc() || (behind != end && !goes_on) || !std::isfinite(numbers.back()))
      throw InputError("{}: has to be a branch's number or X,Y,Z in mm (LPS)", name);
    if (!goes_on) break;
    at = behind + 1;
    numbers.push_back(0);
  }
  if (numbers.size() == 3) {
    const glm::dvec3 point_mm(numbers[0], numbers[1], numbers[2]);
    VesselEnd nearest = nearest_end(tree, point_mm);
    check_near_end(to_glm(nearest.position_mm), point_mm, name);
    return nearest;
  }
  const auto branch = static_cast<int>(std::clamp(numbers[0], -1.0, 1e9));
  if (numbers.size() != 1 || branch != numbers[0])
    throw InputError("{}: has to be a branch's number or X,Y,Z in mm (LPS)", name);
  return end_of_branch(tree, branch, name);
}

double node_spacing_mm(const VesselTree& tree, const InstrumentModel& device) {
  constexpr double kFinest_mm = 1.5, kCoarsest_mm = 5;
  double narrowest_mm = kCoarsest_mm;
  for (const VesselBranch& branch : tree.branches())
    for (const VesselPoint& point : branch.points)
      if (point.radius_mm > device.radius_mm()) narrowest_mm = std::min(narrowest_mm, point.radius_mm);
  return std::clamp(1.5 * narrowest_mm, kFinest_mm, kCoarsest_mm);
}

Catheter::Catheter(const VesselTree& tree, const InstrumentModel& device, const VesselEnd& entry,
                   const Options& options)
    : options_(options),
      rod_(device,
           device.stations_mm(options.spacing_mm > 0 ? options.spacing_mm : node_spacing_mm(tree, device)),
           clamp_at(checked(tree, entry, device)), kIntroducer_mm, {.iterations = options.iterations}),
      wall_(walls(tree, rod_, entry, options.wall_stiffness_N_mm2)) {
  // Its tip's shape comes to rest in the introducer and just before it.
  for (int i = 0; i < 200; ++i) rod_.step(0.01, wall_.get());
}

double Catheter::longest_insertion_mm() const { return rod_.device().length_mm() - kIntroducer_mm; }

void Catheter::step(const HubPose& target) {
  const double most_mm = kFastest_mm_s * options_.step_s, most_rad = kFastest_rad_s * options_.step_s;
  const double wanted_mm = std::clamp(target.insertion_mm, 0.0, longest_insertion_mm());
  const double rotated_rad =
      pose_.rotation_rad + std::clamp(target.rotation_rad - pose_.rotation_rad, -most_rad, most_rad);
  is_held_ = wanted_mm > pose_.insertion_mm && load().force_N > kStrongestPush_N;
  pose_.insertion_mm += std::clamp(wanted_mm - pose_.insertion_mm, -most_mm, is_held_ ? 0 : most_mm);
  if (rotated_rad != pose_.rotation_rad) rod_.rotate_to(rotated_rad);
  pose_.rotation_rad = rotated_rad;
  rod_.feed_to(kIntroducer_mm + pose_.insertion_mm, wall_.get());
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
          .branch = sample.place.branch,
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
          {to_glm(contact.point.place_mm(rod_.state())), to_glm(contact.normal_N + contact.friction_N)});
}

double Catheter::energy_J() const {
  return rod_.elastic_energy_J() + rod_.kinetic_energy_J() + wall_->energy_J();
}

NurbsCurve curve_through(const std::vector<glm::dvec3>& nodes_mm) {
  // Where each control point counts most: its Greville abscissa, the mean of its three inner knots.
  const NurbsCurve first = NurbsCurve::cubic(nodes_mm, "catheter");
  std::vector<double> places;
  for (std::size_t i = 0; i < nodes_mm.size(); ++i)
    places.push_back((first.knots()[i + 1] + first.knots()[i + 2] + first.knots()[i + 3]) / 3);
  std::vector<glm::dvec3> controls = nodes_mm;
  // Each round leaves a third of the distance or less.
  constexpr int kRounds = 8;
  for (int round = 0; round < kRounds; ++round) {
    const NurbsCurve curve = NurbsCurve::cubic(controls, "catheter");
    for (std::size_t i = 0; i < controls.size(); ++i) controls[i] += nodes_mm[i] - curve.at_mm(places[i]);
  }
  return NurbsCurve::cubic(controls, "catheter");
}

}  // namespace xraycast
