#include "xraycast/catheter/wall_contact.hpp"

#include "xraycast/base/wide_vectors.hpp"
#include "xraycast/mechanics/friction_lanes.hpp"
#include "xraycast/mechanics/lane_groups.hpp"
#include "xraycast/mechanics/lanes.hpp"
#include "xraycast/mechanics/units.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <utility>

namespace xraycast {
namespace {

using Eigen::Vector2d, Eigen::Vector3d;

// An introducer is a tube of hard plastic; its stiffness fades over its last millimetres.
constexpr double kIntroducer_N_mm2 = 20, kIntroducerFade_mm = 5;

// The wall bears twice its linear force at a depth of a fifth of its radius, a wall's strain, within limits.
constexpr double kStiffeningStrain = 0.2, kMinStiffening_mm = 0.3, kMaxStiffening_mm = 1;
double squared(double x) { return x * x; }

// While the body moves, a contact's place in the scan is looked up each so many steps, by turns of so many
// contacts, which share what is looked up; in between it goes on by its speed and its change. A beating heart
// leaves that by 0.001 mm in the median, and by up to 0.02 mm where a wave of its contraction begins.
constexpr std::size_t kLookUpSteps = 8, kContactsOfTurn = 8;

double stiffening_mm(const LumenDistanceField::Sample& sample) {
  return std::clamp(kStiffeningStrain * sample.radius_mm, kMinStiffening_mm, kMaxStiffening_mm);
}

/// The nearest positive semidefinite matrix.
Eigen::Matrix3d projected_psd(const Eigen::Matrix3d& matrix) {
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen;
  eigen.computeDirect(matrix);
  return eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0).asDiagonal() *
         eigen.eigenvectors().transpose();
}

[[gnu::always_inline]] inline Lanes lanes_of(const Vector3d& v) { return Lanes{0, v[0], v[1], v[2]}; }

// Vectors of three with a fourth number, 0, and matrices by columns of them: of a body that moves.
using Column = std::array<double, kLanes>;
using Columns = std::array<Column, 3>;
[[gnu::always_inline]] inline Lanes padded(const Vector3d& v) { return Lanes{v[0], v[1], v[2], 0}; }
[[gnu::always_inline]] inline Vector3d unpadded(const Lanes& v) { return {v[0], v[1], v[2]}; }
[[gnu::always_inline]] inline Lanes times(const Columns& matrix, const Lanes& v) {
  return v[0] * load(matrix[0].data()) + v[1] * load(matrix[1].data()) + v[2] * load(matrix[2].data());
}
[[gnu::always_inline]] inline Lanes transposed_times(const Columns& matrix, const Vector3d& v) {
  const std::array<Lanes, kLanes> rows =
      transposed(load(matrix[0].data()), load(matrix[1].data()), load(matrix[2].data()), Lanes{});
  return v[0] * rows[0] + v[1] * rows[1] + v[2] * rows[2];
}
/// Of its inverse, from its columns.
Columns inverse_rows(const Columns& matrix) {
  const Vector3d a(matrix[0].data()), b(matrix[1].data()), c(matrix[2].data());
  const Vector3d bc = b.cross(c), ca = c.cross(a), ab = a.cross(b);
  const double by = 1 / a.dot(bc);
  return {Column{by * bc[0], by * bc[1], by * bc[2], 0}, Column{by * ca[0], by * ca[1], by * ca[2], 0},
          Column{by * ab[0], by * ab[1], by * ab[2], 0}};
}
/// By which a clearance in the scan becomes one in the body: the inverse of the slope across the wall, from
/// the gradient in the scan and the same by the body's place.
[[gnu::always_inline]] inline double scale_of(const Vector3d& gradient, const Lanes& by_body) {
  const Lanes in_scan = padded(gradient);
  const double slope2 = sum(by_body * by_body);
  return slope2 > 0 ? std::sqrt(sum(in_scan * in_scan) / slope2) : 1;
}
[[gnu::always_inline]] inline void add_matrix(const Eigen::Matrix3d& matrix, std::array<Lanes, kLanes>& to) {
  for (Eigen::Index c = 0; c < 3; ++c) to[static_cast<std::size_t>(c) + 1] += lanes_of(matrix.col(c));
}

// Nodes, of which the clamp holds the first, and the middles between them.
std::size_t contact_count(std::size_t nodes) { return 2 * nodes - 3; }
RodPoint contact_point(std::size_t index, std::size_t nodes) {
  const std::size_t node = 1 + index / 2;
  return index % 2 == 0 ? RodPoint::at_node(node, node + 1 == nodes) : RodPoint::at_middle(node);
}

double voronoi_length_mm(const Rod& rod, std::size_t index, std::size_t node) {
  const double edge_mm = rod.from_tip_mm(node - 1) - rod.from_tip_mm(node);
  const double length_mm = 0.5 * (index % 2 == 0 ? rod.voronoi_length_mm(node) : edge_mm);
  // The first edge has no contact at its middle.
  return index == 0 ? length_mm + 0.25 * (rod.from_tip_mm(0) - rod.from_tip_mm(1)) : length_mm;
}

}  // namespace

WallContact::WallContact(std::shared_ptr<const LumenDistanceField> field, const Rod& rod,
                         const Options& options, const std::optional<Introducer>& introducer,
                         std::shared_ptr<MovingBody> body)
    : field_(std::move(field)),
      options_(options),
      introducer_(introducer),
      radius_mm_(rod.instrument().radius_mm()),
      body_(std::move(body)) {
  contacts_.reserve(contact_count(rod.max_nodes()));
  states_.reserve(contact_count(rod.max_nodes()));
  queries_.reserve(contact_count(rod.max_nodes()));
  asking_.reserve(contact_count(rod.max_nodes()));
  acting_.reserve(contact_count(rod.max_nodes()));
  groups_.reserve(contact_count(rod.max_nodes()) / kContactGroup + 1);
  contacts_.resize(contact_count(rod.node_count()));
  states_.resize(contacts_.size());
  if (body_) {
    moving_.reserve(contact_count(rod.max_nodes()));
    moving_.resize(contacts_.size());
  }
  for (std::size_t k = 0; k < contacts_.size(); ++k) {
    contacts_[k].point = contact_point(k, rod.node_count());
    const Vector3d position_mm = contacts_[k].point.position_mm(rod.state());
    states_[k].radius_mm = radius_mm_;
    states_[k].inside = fraction_inside(rod, contacts_[k].point);
    states_[k].hint = field_->locate(in_scan_mm(k, position_mm));
    sample_wall(k, position_mm);
    if (body_) {
      rescale(k, scale_now(k));
      take_depth(k);
    }
    states_[k].stiffening_mm = stiffening_mm(contacts_[k].sample);
  }
}

void WallContact::node_added() {
  // The node and the middle after it.
  contacts_.insert(contacts_.begin(), 2, Contact(contacts_.front()));
  FrictionState state;
  state.hint = states_.front().hint;
  state.stiffening_mm = states_.front().stiffening_mm;
  state.sampled_at_mm = states_.front().sampled_at_mm;
  state.scale = states_.front().scale;
  state.inside = states_.front().inside;
  state.radius_mm = states_.front().radius_mm;
  states_.insert(states_.begin(), 2, state);
  if (body_) moving_.insert(moving_.begin(), 2, MovingPoint(moving_.front()));
}

void WallContact::node_removed() {
  contacts_.erase(contacts_.begin(), contacts_.begin() + 2);
  states_.erase(states_.begin(), states_.begin() + 2);
  if (body_) moving_.erase(moving_.begin(), moving_.begin() + 2);
}

// ---- the wall -------------------------------------------------------------------------------------------

double WallContact::wall_force_N(double depth_mm, std::size_t index) const {
  const FrictionState& state = states_[index];
  return options_.stiffness_N_mm2 * state.voronoi_length_mm * depth_mm *
         (1 + squared(depth_mm / state.stiffening_mm));
}

double WallContact::wall_energy_uJ(double depth_mm, std::size_t index) const {
  const FrictionState& state = states_[index];
  return state.wall_mN_mm * squared(depth_mm) * (0.5 + 0.25 * squared(depth_mm / state.stiffening_mm));
}

double WallContact::introducer_energy_uJ(const Vector3d& point_mm, std::size_t index) const {
  const double stiffness_mN_mm = states_[index].introducer_mN_mm;
  return stiffness_mN_mm > 0 ? 0.5 * stiffness_mN_mm * off_axis_mm(point_mm).squaredNorm() : 0;
}

/// What a contact's point shows at a place of the body.
[[gnu::always_inline]] inline Vector3d WallContact::in_scan_mm(std::size_t index, const Vector3d& point_mm) {
  if (!body_) return point_mm;
  MovingPoint& moving = moving_[index];
  if (!is_following_) look_up(index, point_mm, false);
  return unpadded(load(moving.scan_mm.data()) +
                  times(moving.jacobian, padded(point_mm) - load(moving.body_mm.data())));
}

void WallContact::sample_wall(std::size_t index, const Vector3d& point_mm) {
  const Vector3d place_mm = in_scan_mm(index, point_mm);
  contacts_[index].sample = field_->at(place_mm, states_[index].hint);
  take_sample(index, place_mm);
}

[[gnu::always_inline]] inline void WallContact::take_sample(std::size_t index, const Vector3d& point_mm) {
  Contact& contact = contacts_[index];
  if (body_) {
    MovingPoint& moving = moving_[index];
    moving.gradient = contact.sample.gradient;
    const Lanes by_body = transposed_times(moving.jacobian, moving.gradient);
    // Where a contact may begin: that of another side of the vessel would make it jump later.
    if (is_following_ && contact.depth_mm == 0) states_[index].scale = scale_of(moving.gradient, by_body);
    const double scale = states_[index].scale;
    contact.sample.clearance_mm *= scale;
    contact.sample.gradient = scale * unpadded(by_body);
  }
  take_depth(index);
  states_[index].sampled_at_mm = point_mm;
}

void WallContact::take_depth(std::size_t index) {
  Contact& contact = contacts_[index];
  contact.depth_mm =
      states_[index].is_covered ? 0 : std::max(0.0, states_[index].radius_mm - contact.sample.clearance_mm);
}

/// False where the contact is up to date, or becomes so because the point is known to be clear of the wall.
bool WallContact::needs_sample(std::size_t index, const Vector3d& point_mm) {
  // Within a vessel the clearance changes by little more than the point moves.
  constexpr double kMaxSlope = 1.5;
  const double moved_mm2 = (point_mm - states_[index].sampled_at_mm).squaredNorm();
  // What is in another instrument only needs to know its vessel.
  constexpr double kCoveredMove_mm = 0.5;
  if (states_[index].is_covered && moved_mm2 < squared(kCoveredMove_mm)) {
    contacts_[index].depth_mm = 0;
    return false;
  }
  const LumenDistanceField::Sample& sample = contacts_[index].sample;
  const double clear_mm = sample.clearance_mm - states_[index].radius_mm;
  const double slope = kMaxSlope * states_[index].scale;
  if (sample.hint.branch == states_[index].hint.branch && clear_mm > 0 &&
      squared(slope) * moved_mm2 < squared(clear_mm)) {
    contacts_[index].depth_mm = 0;
    return false;
  }
  return moved_mm2 > 0;
}

/// Samples the wall at all points that need it at once.
XRAYCAST_WIDE_VECTORS
void WallContact::sample_walls(const RodState& rod) {
  queries_.clear();
  asking_.clear();
  for (const std::size_t k : acting_) {
    const Vector3d place_mm = in_scan_mm(k, contacts_[k].point.position_mm(rod));
    if (needs_sample(k, place_mm)) ask(k, place_mm, states_[k].hint);
  }
  take_answers();
}

void WallContact::ask(std::size_t index, const Vector3d& in_scan_mm,
                      const LumenDistanceField::SearchHint& from) {
  queries_.push_back({in_scan_mm, from, &contacts_[index].sample});
  asking_.push_back(index);
}

XRAYCAST_WIDE_VECTORS
void WallContact::take_answers() {
  field_->sample(queries_);
  for (std::size_t q = 0; q < asking_.size(); ++q) take_sample(asking_[q], queries_[q].point_mm);
}

/// Of a balloon that fills its vessel; none where it lies at one side of a wider one.
double WallContact::pressing_N_mm(const Contact& contact, const FrictionState& state) const {
  constexpr double kFills_mm = 0.05;
  return contact.sample.radius_mm < state.radius_mm + kFills_mm ? state.pressing_N_mm : 0;
}

void WallContact::take_walls(std::shared_ptr<const LumenDistanceField> field,
                             const std::optional<Balloon>& balloon, const Rod& rod) {
  const double before_uJ = stored_uJ();
  field_ = std::move(field);
  for (std::size_t k = 0; k < contacts_.size(); ++k) {
    FrictionState& state = states_[k];
    const RodPoint point = contact_point(k, rod.node_count());
    const double from_tip_mm =
        point.start_weight * rod.from_tip_mm(point.edge) + point.end_weight * rod.from_tip_mm(point.edge + 1);
    const bool is_balloon = balloon && from_tip_mm >= balloon->from_mm && from_tip_mm <= balloon->to_mm;
    state.radius_mm = is_balloon ? balloon->radius_mm : radius_mm_;
    state.pressing_N_mm = is_balloon ? balloon->pressing_N_mm : 0;
    state.hint = contacts_[k].sample.hint;
    sample_wall(k, point.position_mm(rod.state()));
  }
  work_uJ_ += stored_uJ() - before_uJ;
}

WallContact::TipPlace WallContact::tip_place(const Rod& rod) const {
  Vector3d scan_mm = rod.state().nodes_mm.back();
  if (body_) {
    const MovingPoint& moving = moving_.back();
    scan_mm = unpadded(load(moving.scan_mm.data()) +
                       times(moving.jacobian, padded(scan_mm) - load(moving.body_mm.data())));
  }
  const LumenDistanceField::Sample sample = field_->at(scan_mm, contacts_.back().sample.hint);
  return {scan_mm, sample.hint.branch, sample.arc_length_mm};
}

// ---- a body that moves ----------------------------------------------------------------------------------

double WallContact::scale_now(std::size_t index) const {
  const MovingPoint& moving = moving_[index];
  return scale_of(moving.gradient, transposed_times(moving.jacobian, moving.gradient));
}

void WallContact::rescale(std::size_t index, double scale) {
  Contact& contact = contacts_[index];
  const double by = scale / states_[index].scale;
  states_[index].scale = scale;
  contact.sample.clearance_mm *= by;
  contact.sample.gradient *= by;
  if (contact.depth_mm > 0)
    contact.depth_mm = std::max(0.0, states_[index].radius_mm - contact.sample.clearance_mm);
}

/// Minus the second derivative of the clearance in the body; where the way to the scan bends, which it does
/// over centimetres, is left out.
[[gnu::always_inline]] inline Eigen::Matrix3d WallContact::curvature(std::size_t index) const {
  const LumenDistanceField::Sample& sample = contacts_[index].sample;
  if (!body_ || body_->is_still()) return sample.curvature();
  const Columns& jacobian = moving_[index].jacobian;
  const double scale = states_[index].scale;
  const auto* one = std::get_if<LumenDistanceField::WallCurvature>(&sample.wall);
  Columns curved;
  if (one) {
    // As WallCurvature::matrix.
    const Lanes across = transposed_times(jacobian, moving_[index].gradient),
                along = transposed_times(jacobian, one->transverse);
    const double by_along = one->slope_change < 0 ? 1 / one->slope_change : 0;
    for (std::size_t c = 0; c < 3; ++c)
      store(curved[c].data(),
            (scale / one->distance_mm) * (transposed_times(jacobian, Vector3d(jacobian[c].data())) -
                                          across[c] * across + (by_along * along[c]) * along));
  } else {
    const auto& in_scan = std::get<Eigen::Matrix3d>(sample.wall);
    for (std::size_t c = 0; c < 3; ++c)
      store(curved[c].data(),
            scale * transposed_times(jacobian, Vector3d(in_scan * Vector3d(jacobian[c].data()))));
  }
  Eigen::Matrix3d matrix;
  for (std::size_t c = 0; c < 3; ++c) matrix.col(static_cast<Eigen::Index>(c)) = Vector3d(curved[c].data());
  return matrix;
}

/// Of the body, but where the introducer holds the rod: there it stays as it was when the introducer was put
/// in. Else a wall of the vessel that goes on around it would be pressed against what cannot give way.
[[gnu::always_inline]] inline MovingBody::Place WallContact::place_of(std::size_t index,
                                                                      const Vector3d& point_mm) {
  const double inside = states_[index].inside, held = inside * inside * (3 - 2 * inside);
  if (held == 0) return body_->place(point_mm);
  MovingBody::Place place;
  if (held < 1) place = body_->place(point_mm);
  const MovingBody::Place& rest = introducer_->place;
  // Displacements are blended, so that without any a place is itself to the last bit.
  const Lanes exit_mm = padded(introducer_->exit_mm), at_mm = padded(point_mm), off_mm = at_mm - exit_mm;
  const double free = 1 - held;
  Lanes rest_mm = load(rest.scan_mm.data()) - exit_mm;
  for (std::size_t c = 0; c < 3; ++c) {
    Lanes itself{};
    itself[c] = 1;
    const Lanes slope = load(rest.jacobian[c].data()) - itself;
    rest_mm += off_mm[c] * slope;
    const Lanes of_body = held < 1 ? free * (load(place.jacobian[c].data()) - itself) : Lanes{};
    store(place.jacobian[c].data(), itself + (of_body + held * slope));
  }
  const Lanes of_body_mm = held < 1 ? free * (load(place.scan_mm.data()) - at_mm) : Lanes{};
  store(place.scan_mm.data(), at_mm + (of_body_mm + held * rest_mm));
  store(place.moved_mm.data(), held < 1 ? free * load(place.moved_mm.data()) : Lanes{});
  return place;
}

/// `goes_on`: what it has become by its course so far corrects that.
[[gnu::always_inline]] inline void WallContact::look_up(std::size_t index, const Vector3d& point_mm,
                                                        bool goes_on) {
  MovingPoint& moving = moving_[index];
  const MovingBody::Place place = place_of(index, point_mm);
  if (goes_on) {
    constexpr double kShare = 1.0 / kLookUpSteps;
    const auto correction = [](const Column& is, const Column& became) __attribute__((always_inline)) {
      return kShare * (load(is.data()) - load(became.data()));
    };
    add_to(moving.moved_change_mm.data(), correction(place.moved_mm, moving.moved_mm));
    for (std::size_t c = 0; c < 3; ++c)
      add_to(moving.jacobian_change[c].data(), correction(place.jacobian[c], moving.jacobian[c]));
    // A wall that jumped would push.
    store(moving.catch_up_mm.data(), correction(place.scan_mm, moving.scan_mm));
  } else {
    moving.catch_up_mm = {};
    moving.scan_mm = place.scan_mm;
  }
  store(moving.body_mm.data(), padded(point_mm));
  moving.moved_mm = place.moved_mm;
  moving.jacobian = place.jacobian;
  if (is_following_) moving.to_body = inverse_rows(place.jacobian);
}

/// To second order, without another sample: what the wall's material brings, which is `moved_mm` away in the
/// scan, is as far from the rod as that lay from it before.
[[gnu::always_inline]] inline void WallContact::shift_wall(std::size_t index, const Vector3d& moved_mm) {
  Contact& contact = contacts_[index];
  MovingPoint& moving = moving_[index];
  LumenDistanceField::Sample& sample = contact.sample;
  const auto* one = std::get_if<LumenDistanceField::WallCurvature>(&sample.wall);
  const Vector3d turned = one ? one->times(moving.gradient, moved_mm)
                              : Vector3d(std::get<Eigen::Matrix3d>(sample.wall) * moved_mm);
  const double in_scan_mm =
      sample.clearance_mm / states_[index].scale - (moving.gradient + 0.5 * turned).dot(moved_mm);
  moving.gradient += turned;
  const Lanes by_body = transposed_times(moving.jacobian, moving.gradient);
  const double scale = states_[index].scale = scale_of(moving.gradient, by_body);
  sample.clearance_mm = scale * in_scan_mm;
  sample.gradient = scale * unpadded(by_body);
  contact.depth_mm = std::max(0.0, states_[index].radius_mm - sample.clearance_mm);
  states_[index].sampled_at_mm = unpadded(load(moving.scan_mm.data()));
}

/// Where the wall is out of reach, that is all; else it is shifted or, where it was not sampled as the last
/// step ended, sampled anew.
[[gnu::always_inline]] inline void WallContact::follow_body(const Rod& rod, std::size_t index) {
  Contact& contact = contacts_[index];
  MovingPoint& moving = moving_[index];
  contact.point = contact_point(index, rod.node_count());
  const Vector3d point_mm = contact.point.position_mm(rod.state());
  const Lanes off_mm = padded(point_mm) - load(moving.body_mm.data()),
              before_mm = load(moving.scan_mm.data()) + times(moving.jacobian, off_mm);
  const std::size_t turn = followed_ + (contacts_.size() - index) / kContactsOfTurn;
  if (!was_following_ || states_[index].inside > 0) {
    moving.moved_change_mm = {};
    moving.jacobian_change = {};
    look_up(index, point_mm, false);
  } else {
    add_to(moving.moved_mm.data(), load(moving.moved_change_mm.data()));
    for (std::size_t c = 0; c < 3; ++c)
      add_to(moving.jacobian[c].data(), load(moving.jacobian_change[c].data()));
    store(moving.scan_mm.data(), load(moving.scan_mm.data()) + times(moving.jacobian, off_mm) +
                                     load(moving.moved_mm.data()) + load(moving.catch_up_mm.data()));
    store(moving.body_mm.data(), padded(point_mm));
    if (turn % kLookUpSteps == 0) look_up(index, point_mm, true);
  }
  const Lanes by_mm = before_mm - load(moving.scan_mm.data());
  moving.wall_moved_mm = unpadded(transposed_times(moving.to_body, unpadded(by_mm)));
  const Vector3d place_mm = unpadded(load(moving.scan_mm.data()));
  if (!needs_sample(index, place_mm)) return;
  constexpr double kSame_mm = 1e-6;
  const bool is_sampled =
      (unpadded(before_mm) - states_[index].sampled_at_mm).squaredNorm() < squared(kSame_mm);
  if (is_sampled && !states_[index].is_covered)
    shift_wall(index, unpadded(by_mm));
  else
    ask(index, place_mm, contact.sample.hint);
}

XRAYCAST_WIDE_VECTORS
void WallContact::follow_body(const Rod& rod) {
  is_following_ = starts_anew_ = true;
  ++followed_;
  queries_.clear();
  asking_.clear();
  for (std::size_t k = 0; k < contacts_.size(); ++k) follow_body(rod, k);
  take_answers();
}

Vector3d WallContact::off_axis_mm(const Vector3d& point_mm) const {
  const Vector3d offset = point_mm - introducer_->exit_mm;
  return offset - offset.dot(introducer_->axis) * introducer_->axis;
}

// ---- a step begins --------------------------------------------------------------------------------------

void WallContact::begin_step(const Rod& rod, double bare_mm) {
  acting_.clear();
  for (std::size_t k = 0; k < contacts_.size(); ++k) {
    begin_contact(rod, k, bare_mm);
    if (!states_[k].is_covered) acting_.push_back(k);
  }
  make_groups();
}

void WallContact::begin_contact(const Rod& rod, std::size_t index, double bare_mm) {
  Contact& contact = contacts_[index];
  FrictionState& state = states_[index];
  contact.point = contact_point(index, rod.node_count());
  state.voronoi_length_mm = voronoi_length_mm(rod, index, contact.point.edge + 1);
  const bool had_no_depth = state.is_covered;
  if (std::isfinite(bare_mm)) {
    const double bare = fraction_bare(rod, index, bare_mm);
    state.voronoi_length_mm *= bare;
    state.is_covered = bare == 0;
  }
  if (state.is_covered && !had_no_depth)
    for (Vector3d* force_N : {&contact.normal_N, &contact.friction_N, &contact.introducer_N})
      force_N->setZero();
  state.wall_mN_mm = options_.stiffness_N_mm2 / kMilli * state.voronoi_length_mm;
  state.friction.spring_mN_mm = options_.tangential_N_mm2 / kMilli * state.voronoi_length_mm;
  const double inside = state.inside = fraction_inside(rod, contact.point);
  state.introducer_mN_mm =
      kIntroducer_N_mm2 / kMilli * state.voronoi_length_mm * inside * inside * (3 - 2 * inside);
  state.start_mm = state.anchor_mm = contact.point.position_mm(rod.state());
  if (is_following_) state.anchor_mm += moving_[index].wall_moved_mm;
  state.introducer_uJ = introducer_energy_uJ(state.start_mm, index);
  update_hint(index);
  // What was sampled within another instrument has no depth.
  if (had_no_depth && !state.is_covered) sample_wall(index, state.start_mm);
  if (body_ && !is_following_) hold_scale(index);
  if (contact.depth_mm > 0) return begin_friction(rod.state().edges[contact.point.edge].tangent, index);
  state.friction.limit_mN = 0;
  // The step may begin again, and uncover it.
  if (state.is_covered && !state.was_covered) return;
  contact.slips = false;
  state.stick_mm.setZero();
  // For as long as the next contact lasts: a wall whose stiffness changed under a load would make energy.
  state.stiffening_mm = stiffening_mm(contact.sample);
}

/// Of the introducer: 1 where a point is held by it in full, 0 beyond its exit.
double WallContact::fraction_inside(const Rod& rod, const RodPoint& point) const {
  const double length_mm =
      introducer_ ? (introducer_->exit_mm - rod.clamp().position_mm).dot(introducer_->axis) : 0;
  // Counted along the rod: what has been fed through is outside, even where it turns back beside it.
  const double from_tip_mm =
      point.start_weight * rod.from_tip_mm(point.edge) + point.end_weight * rod.from_tip_mm(point.edge + 1);
  return std::clamp((length_mm - rod.fed_mm() + from_tip_mm) / kIntroducerFade_mm, 0.0, 1.0);
}

/// Of the length that a contact stands for, as far as the wall acts on it.
double WallContact::fraction_bare(const Rod& rod, std::size_t index, double bare_mm) const {
  const RodPoint& point = contacts_[index].point;
  const double length_mm = states_[index].voronoi_length_mm;
  const double from_tip_mm =
      point.start_weight * rod.from_tip_mm(point.edge) + point.end_weight * rod.from_tip_mm(point.edge + 1);
  const double first_mm = std::max(0.0, from_tip_mm - 0.5 * length_mm);
  return std::clamp((bare_mm - first_mm) / length_mm, 0.0, 1.0);
}

/// The search goes on from where the last step ended or, if the preceding point is in another vessel, from
/// there, so that the rod passes from one vessel into another only where they meet. What would be deeper at
/// once by more than a rod moves in a step lies where vessels meet that the tree has apart, as where a loop
/// was cut or a malformation's vessels merge: it stays in its own.
void WallContact::update_hint(std::size_t index) {
  constexpr double kDeeper_mm = 0.5;
  FrictionState& state = states_[index];
  const int branch_before = state.hint.branch;
  const LumenDistanceField::SearchHint own = contacts_[index].sample.hint;
  state.hint = own;
  if (index > 0 && contacts_[index - 1].sample.hint.branch != state.hint.branch)
    state.hint = contacts_[index - 1].sample.hint;
  if (state.hint.branch != branch_before) {
    const double depth_mm = contacts_[index].depth_mm;
    sample_wall(index, state.start_mm);
    if (contacts_[index].depth_mm > depth_mm + kDeeper_mm) {
      state.hint = own;
      sample_wall(index, state.start_mm);
    }
  } else if (!starts_anew_ && needs_sample(index, in_scan_mm(index, state.start_mm))) {
    sample_wall(index, state.start_mm);
  }
}

/// In a body that is held, but for what would make a contact deeper, or begin one: that would make energy.
void WallContact::hold_scale(std::size_t index) {
  const double now = scale_now(index), clearance_mm = contacts_[index].sample.clearance_mm;
  if (now / states_[index].scale * clearance_mm >= std::min(clearance_mm, states_[index].radius_mm))
    rescale(index, now);
}

void WallContact::begin_friction(const Vector3d& rod_tangent, std::size_t index) {
  const Contact& contact = contacts_[index];
  FrictionState& state = states_[index];
  const double coefficient = contact.slips ? options_.kinetic_friction : options_.static_friction;
  const double pressing_N =
      wall_force_N(contact.depth_mm, index) + state.voronoi_length_mm * pressing_N_mm(contact, state);
  state.friction.limit_mN = coefficient / kMilli * pressing_N;
  const Vector3d normal = contact.sample.gradient.normalized();
  const Vector3d across = normal.cross(rod_tangent);
  const double sine = across.norm();
  // A tip that pushes straight into a wall, or an axis on the centreline of a vessel that is too narrow: any
  // tangent will do.
  const Vector3d t2 = sine > 1e-6                ? Vector3d(across / sine)
                      : normal.squaredNorm() > 0 ? normal.unitOrthogonal()
                                                 : rod_tangent.unitOrthogonal();
  const Vector3d t1 = t2.cross(normal), stick_mm = state.stick_mm;
  state.t1 = t1;
  state.t2 = t2;
  state.start_slip_mm = {stick_mm.dot(t1), stick_mm.dot(t2)};
}

void WallContact::make_groups() {
  groups_.clear();
  for (const std::size_t k : acting_) {
    if (!states_[k].friction.is_active()) continue;
    if (groups_.empty() || groups_.back().count == kContactGroup) groups_.emplace_back();
    add_to_group(k, groups_.back());
  }
}

void WallContact::add_to_group(std::size_t index, RubbingGroup& group) const {
  const RodPoint& point = contacts_[index].point;
  const FrictionState& state = states_[index];
  const std::size_t first = group.count++;
  group.contacts[first] = index;
  // The first one fills up the others.
  for (std::size_t k = first; k < (first == 0 ? kContactGroup : first + 1); ++k) {
    group.edges[k] = point.edge;
    group.start_weights[k] = point.start_weight;
    group.end_weights[k] = point.end_weight;
    group.theta_weights[k] = point.theta_weight;
    group.next_theta_weights[k] = point.next_theta_weight;
    group.spring_mN_mm[k] = state.friction.spring_mN_mm;
    group.limit_mN[k] = state.friction.limit_mN;
    group.start_along_mm[k] = state.start_slip_mm[0];
    group.start_around_mm[k] = state.start_slip_mm[1];
    group.radius_mm[k] = state.radius_mm;
    set_lane(state.anchor_mm, k, group.anchor_mm);
    set_lane(state.t1, k, group.t1);
    set_lane(state.t2, k, group.t2);
  }
}

// ---- the potential --------------------------------------------------------------------------------------

Vector2d WallContact::slip_mm(const RodState& rod, std::size_t index) const {
  const FrictionState& state = states_[index];
  const RodPoint& point = contacts_[index].point;
  const Vector3d moved = point.position_mm(rod) - state.anchor_mm;
  return {state.start_slip_mm[0] + moved.dot(state.t1),
          state.start_slip_mm[1] + moved.dot(state.t2) + state.radius_mm * point.theta_rad(rod)};
}

/// Of a group, at a state.
struct WallContact::GroupFriction {
  FrictionLanes of;

  [[gnu::always_inline]] GroupFriction(const RubbingGroup& group, const RodState& rod) {
    const Triple<Lanes> start_mm = positions_mm(rod, group.edges, 0),
                        end_mm = positions_mm(rod, group.edges, 1);
    const Triple<Lanes> moved =
        (lanes_of(group.start_weights) * start_mm + lanes_of(group.end_weights) * end_mm) -
        triple_of(group.anchor_mm);
    Lanes theta_rad, next_theta_rad;
    const std::size_t last = rod.thetas_rad.size() - 1;
    for (std::size_t k = 0; k < kContactGroup; ++k) {
      theta_rad[k] = rod.thetas_rad[group.edges[k]];
      next_theta_rad[k] = rod.thetas_rad[std::min(group.edges[k] + 1, last)];  // of no weight at the tip
    }
    const Lanes turned_mm = lanes_of(group.radius_mm) * (lanes_of(group.theta_weights) * theta_rad +
                                                         lanes_of(group.next_theta_weights) * next_theta_rad);
    of = {lanes_of(group.spring_mN_mm), lanes_of(group.limit_mN),
          lanes_of(group.start_along_mm) + dot(moved, triple_of(group.t1)),
          lanes_of(group.start_around_mm) + dot(moved, triple_of(group.t2)) + turned_mm};
  }
};

XRAYCAST_WIDE_VECTORS
double WallContact::friction_uJ(const RodState& rod) const {
  double energy = 0;
  for (const RubbingGroup& group : groups_) {
    const Lanes energies = GroupFriction(group, rod).of.energy_uJ();
    for (std::size_t k = 0; k < group.count; ++k) energy += energies[k];
  }
  return energy;
}

double WallContact::energy_uJ(const RodState& rod) {
  if (!std::exchange(starts_anew_, false)) sample_walls(rod);
  double energy = friction_uJ(rod);
  for (const std::size_t k : acting_) {
    FrictionState& state = states_[k];
    energy += wall_energy_uJ(contacts_[k].depth_mm, k);
    state.introducer_uJ = introducer_energy_uJ(contacts_[k].point.position_mm(rod), k);
    energy += state.introducer_uJ;
  }
  return energy;
}

void WallContact::assemble(const RodState& rod, bool project_psd, const RodRows& rows) {
  for (const RubbingGroup& group : groups_) assemble_group(rod, group, project_psd, rows);
  for (const std::size_t k : acting_)
    if (!states_[k].friction.is_active() && (contacts_[k].depth_mm > 0 || states_[k].introducer_mN_mm > 0))
      assemble_contact(rod, k, project_psd, rows);
}

/// Of one contact, over the angle and the position; the Hessian by columns.
struct WallContact::Derivatives {
  Lanes gradient{};
  std::array<Lanes, kLanes> hessian{};

  [[gnu::always_inline]] void add_to(const RodPoint& point, const RodRows& rows) const {
    Eigen::Vector4d by_point;
    Eigen::Matrix4d of_point;
    store(by_point.data(), gradient);
    for (std::size_t c = 0; c < kLanes; ++c) store(of_point.data() + kLanes * c, hessian[c]);
    rows.add(point, by_point, of_point);
  }
};

/// And of the introducer.
[[gnu::always_inline]] inline void WallContact::add_wall(const RodState& rod, std::size_t index,
                                                         bool project_psd, Derivatives& of) const {
  const Contact& contact = contacts_[index];
  const FrictionState& state = states_[index];
  if (state.introducer_mN_mm > 0) {
    const Vector3d& axis = introducer_->axis;
    of.gradient += lanes_of(state.introducer_mN_mm * off_axis_mm(contact.point.position_mm(rod)));
    add_matrix(state.introducer_mN_mm * (Eigen::Matrix3d::Identity() - axis * axis.transpose()), of.hessian);
  }
  if (contact.depth_mm > 0) {
    const double force_mN = wall_force_N(contact.depth_mm, index) / kMilli;
    const double stiffness = state.wall_mN_mm * (1 + 3 * squared(contact.depth_mm / state.stiffening_mm));
    const Vector3d& inward = contact.sample.gradient;
    of.gradient -= force_mN * lanes_of(inward);
    // The normal force turns as the point moves along a curved wall.
    Eigen::Matrix3d wall = stiffness * inward * inward.transpose() + force_mN * curvature(index);
    if (project_psd) wall = projected_psd(wall);
    add_matrix(wall, of.hessian);
  }
}

XRAYCAST_WIDE_VECTORS
void WallContact::assemble_group(const RodState& rod, const RubbingGroup& group, bool project_psd,
                                 const RodRows& rows) const {
  const FrictionLanes::Derivatives friction = GroupFriction(group, rod).of.derivatives();
  const std::array<Lanes, kLanes> alongs = by_lane(Lanes{}, triple_of(group.t1)),
                                  arounds = by_lane(lanes_of(group.radius_mm), triple_of(group.t2));
  for (std::size_t k = 0; k < group.count; ++k) {
    const std::size_t index = group.contacts[k];
    const Lanes along = alongs[k], around = arounds[k];
    Derivatives of;
    of.gradient = friction.x_mN[k] * along + friction.y_mN[k] * around;
    const Lanes by_along = friction.xx_mN_mm[k] * along + friction.xy_mN_mm[k] * around,
                by_around = friction.xy_mN_mm[k] * along + friction.yy_mN_mm[k] * around;
    for (std::size_t c = 0; c < kLanes; ++c) of.hessian[c] = along[c] * by_along + around[c] * by_around;
    add_wall(rod, index, project_psd, of);
    of.add_to(contacts_[index].point, rows);
  }
}

XRAYCAST_WIDE_VECTORS
void WallContact::assemble_contact(const RodState& rod, std::size_t index, bool project_psd,
                                   const RodRows& rows) const {
  Derivatives of;
  add_wall(rod, index, project_psd, of);
  of.add_to(contacts_[index].point, rows);
}

// ---- a step ends ----------------------------------------------------------------------------------------

void WallContact::end_step(const RodState& rod) {
  sample_wall(contacts_.size() - 1, rod.nodes_mm.back());  // the tip's location is asked for
  const double kinetic_share =
      options_.static_friction == 0 ? 1 : options_.kinetic_friction / options_.static_friction;
  for (FrictionState& state : states_) state.was_covered = state.is_covered;
  for (const std::size_t k : acting_) {
    Contact& contact = contacts_[k];
    FrictionState& state = states_[k];
    contact.normal_N = wall_force_N(contact.depth_mm, k) * contact.sample.gradient;
    contact.introducer_N.setZero();
    if (state.introducer_mN_mm > 0)
      contact.introducer_N = -kMilli * state.introducer_mN_mm * off_axis_mm(contact.point.position_mm(rod));
    contact.friction_N.setZero();
    state.stick_mm.setZero();
    if (is_following_) work_uJ_ += contact.normal_N.dot(moving_[k].wall_moved_mm) / kMilli;
    if (!state.friction.is_active()) continue;

    // Where it slipped in the last step, the limit was the kinetic one already.
    const Friction::Returned returned =
        state.friction.return_map(slip_mm(rod, k), contact.slips ? 1 : kinetic_share);
    contact.slips = returned.slips;
    contact.friction_N = kMilli * (returned.force_mN[0] * state.t1 + returned.force_mN[1] * state.t2);
    state.stick_mm = returned.displacement_mm[0] * state.t1 + returned.displacement_mm[1] * state.t2;
    if (is_following_) work_uJ_ += contact.friction_N.dot(moving_[k].wall_moved_mm) / kMilli;
  }
  was_following_ = std::exchange(is_following_, false);
}

double WallContact::work_J() const { return kMicro * work_uJ_; }

double WallContact::energy_J() const { return kMicro * stored_uJ(); }

double WallContact::stored_uJ() const {
  double energy = 0;
  for (std::size_t k = 0; k < contacts_.size(); ++k) {
    const FrictionState& state = states_[k];
    energy += wall_energy_uJ(contacts_[k].depth_mm, k) + state.introducer_uJ +
              0.5 * state.friction.spring_mN_mm * state.stick_mm.squaredNorm();
  }
  return energy;
}

}  // namespace xraycast
