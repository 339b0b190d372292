#include "xraycast/coaxial/instruments.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/mechanics/vectors.hpp"

#include <glm/matrix.hpp>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace xraycast {
namespace {

// The straight sheath outside the tree through which instruments enter: its length.
constexpr double kIntroducer_mm = 20;

// Balloons are worked on so often: at the fastest inflation they grow by some 0.05 mm in between.
constexpr long kBalloonSteps = 10;
// A balloon that is held at a pressure stays where it is while it moves by less.
constexpr double kBalloonMoves_mm = 0.25;
// Of the pressure in a balloon, what is left for the wall; its membrane bears the rest. Chosen: at 8 bar a
// balloon of 6 by 20 mm is held against a push of 3 N at a coefficient of friction of 0.1.
constexpr double kPressingShare = 0.1, kNewtonPerMm2PerBar = 0.1;

/// Throws InputError.
const std::vector<InstrumentModel>& checked(const VesselTree& tree, const VesselEnd& entry,
                                            const std::vector<InstrumentModel>& instruments) {
  check_instruments(instruments);
  check_fits(tree, entry, instruments.front());
  return instruments;
}

double node_spacing_mm(const VesselTree& tree, const InstrumentModel& model) {
  constexpr double kMinSpacing_mm = 1.5, kMaxSpacing_mm = 5;
  double min_radius_mm = kMaxSpacing_mm;
  for (const VesselBranch& branch : tree.branches())
    for (const VesselPoint& point : branch.points)
      if (point.radius_mm > model.radius_mm()) min_radius_mm = std::min(min_radius_mm, point.radius_mm);
  return std::clamp(1.5 * min_radius_mm, kMinSpacing_mm, kMaxSpacing_mm);
}

/// Where instruments are fed in: the introducer's outer end.
Rod::Clamp clamp_at(const VesselEnd& entry) {
  const Eigen::Vector3d axis = -entry.outward;
  return {.position_mm = entry.position_mm + kIntroducer_mm * entry.outward,
          .axis = axis,
          .m1 = axis.unitOrthogonal()};
}

/// Where an end of the tree is in the body.
VesselEnd in_body(VesselEnd end, MovingBody* body) {
  if (!body) return end;
  const HeldMotion held = body->motion().held_at(body->phases());
  end.position_mm = to_eigen(held.inverse_mm(to_glm(end.position_mm)).x_mm);
  const glm::dvec3 outward = glm::inverse(held.jacobian(to_glm(end.position_mm))) * to_glm(end.outward);
  end.outward = to_eigen(outward).normalized();
  return end;
}

std::shared_ptr<MovingBody> body_of(const Instruments::Options& options) {
  return options.motion ? std::make_shared<MovingBody>(options.motion, options.phases) : nullptr;
}

/// The vessels; that of the entry goes on around the introducer and a little further.
std::shared_ptr<const LumenDistanceField> lumen_with_introducer(const VesselTree& tree,
                                                                const VesselEnd& entry) {
  constexpr double kOpening_mm = kIntroducer_mm + 10;
  return std::make_shared<LumenDistanceField>(tree, &entry, kOpening_mm);
}

}  // namespace

double max_insertion_mm(const InstrumentModel& model) { return model.length_mm() - kIntroducer_mm; }

std::vector<double> max_insertions_mm(const std::vector<InstrumentModel>& models) {
  std::vector<double> insertions_mm;
  for (const InstrumentModel& model : models) insertions_mm.push_back(max_insertion_mm(model));
  return insertions_mm;
}

void check_instruments(const std::vector<InstrumentModel>& instruments) {
  if (instruments.empty() || instruments.size() > Instruments::kMaxCount)
    throw InputError("{} instruments; give one to {}, the outermost first", instruments.size(),
                     Instruments::kMaxCount);
  for (std::size_t outer = 0; outer < instruments.size(); ++outer)
    for (std::size_t inner = outer + 1; inner < instruments.size(); ++inner)
      check_fits_inside(instruments[outer], instruments[inner]);
}

Instruments::Instruments(const VesselTree& tree, const std::vector<InstrumentModel>& instruments,
                         const VesselEnd& entry, const Options& options)
    : tree_(tree),
      options_(options),
      body_(body_of(options)),
      end_(entry),
      entry_(in_body(entry, body_.get())),
      entry_place_(body_ ? body_->place(entry_.position_mm) : MovingBody::Place{}),
      treatments_(lumen_with_introducer(tree, entry)),
      rods_(make_rods(checked(tree, entry, instruments))),
      walls_(instruments.size()),
      hubs_(instruments.size()),
      balloons_(instruments.size()) {
  for (std::size_t d = 0; d < count(); ++d) balloons_[d].carries_stent = instruments[d].stent().has_value();
  for (std::size_t d = 0; d < count(); ++d) {
    walls_[d] = make_wall(rods_, d);
    rods_.set_external(d, walls_[d].get());
  }
  settle(rods_);
}

Rod Instruments::make_rod(const InstrumentModel& model) const {
  const double spacing_mm = options_.spacing_mm > 0 ? options_.spacing_mm : node_spacing_mm(tree_, model);
  return {model,
          model.stations_mm(spacing_mm),
          clamp_at(entry_),
          kIntroducer_mm,
          {.max_iterations = options_.max_iterations, .max_node_iterations = options_.max_node_iterations}};
}

std::vector<Rod> Instruments::make_rods(const std::vector<InstrumentModel>& instruments) const {
  std::vector<Rod> rods;
  for (const InstrumentModel& model : instruments) rods.push_back(make_rod(model));
  return rods;
}

std::unique_ptr<WallContact> Instruments::make_wall(const CoaxialRods& rods, std::size_t instrument) const {
  const Rod& rod = rods.rod(instrument);
  std::optional<WallContact::Introducer> introducer;
  if (instrument == 0) introducer = {entry_.position_mm, -entry_.outward, entry_place_};
  return std::make_unique<WallContact>(
      treatments_.walls().field(), rod,
      WallContact::Options{.stiffness_N_mm2 = options_.wall_stiffness_N_mm2,
                           .tangential_N_mm2 = options_.wall_stiffness_N_mm2,
                           .static_friction = rod.instrument().static_friction(),
                           .kinetic_friction = rod.instrument().kinetic_friction()},
      introducer, body_);
}

/// The rest shapes of the tips relax in the introducer and just outside it.
void Instruments::settle(CoaxialRods& rods) {
  for (int i = 0; i < 200; ++i) rods.step(0.01);
}

double Instruments::max_insertion_mm(std::size_t instrument) const {
  return xraycast::max_insertion_mm(rod(instrument).instrument());
}

std::span<const double> Instruments::phases() const {
  return body_ ? std::span<const double>(body_->phases()) : std::span<const double>();
}

void Instruments::step(std::span<const HubPose> targets, std::span<const double> phases) {
  for (std::size_t d = 0; d < count(); ++d) {
    const double rotation_before_rad = pose(d).rotation_rad;
    const HubPose largest{.insertion_mm = max_insertion_mm(d),
                          .inflation_bar = rod(d).instrument().max_inflation_bar()};
    hubs_[d].approach(targets[d], load(d).force_N, largest, options_.step_s);
    if (pose(d).rotation_rad != rotation_before_rad) rods_.rotate_to(d, pose(d).rotation_rad);
    rods_.feed_to(d, kIntroducer_mm + pose(d).insertion_mm);
  }
  if (steps_ % kBalloonSteps == 0) work_balloons();
  if (body_ && body_->move_to(phases))
    for (std::size_t d = 0; d < count(); ++d) walls_[d]->follow_body(rod(d));
  rods_.step(options_.step_s);
  ++steps_;
}

bool Instruments::is_held() const {
  return std::any_of(hubs_.begin(), hubs_.end(), [](const MovingHub& hub) { return hub.is_held; });
}

HubLoad Instruments::load(std::size_t instrument) const {
  const Rod& of = rod(instrument);
  return {.force_N = -of.clamp_force_N().dot(of.clamp().axis), .torque_Nm = -of.clamp_torque_Nm()};
}

InstrumentTip Instruments::tip(std::size_t instrument) const {
  const WallContact::TipPlace place = wall(instrument).tip_place(rod(instrument));
  return {.position_mm = to_glm(rod(instrument).state().nodes_mm.back()),
          .direction = to_glm(rod(instrument).state().edges.back().tangent),
          .branch = place.branch,
          .arc_length_mm = place.arc_length_mm,
          .scan_mm = to_glm(place.scan_mm)};
}

void Instruments::copy_nodes(std::size_t instrument, std::vector<glm::dvec3>& nodes_mm) const {
  nodes_mm.clear();
  for (const Eigen::Vector3d& node : rod(instrument).state().nodes_mm) nodes_mm.push_back(to_glm(node));
}

void Instruments::copy_contacts(std::size_t instrument, std::vector<InstrumentContact>& contacts) const {
  contacts.clear();
  for (const WallContact::Contact& contact : wall(instrument).contacts())
    if (contact.depth_mm > 0)
      contacts.push_back({to_glm(contact.point.position_mm(rod(instrument).state())),
                          to_glm(contact.normal_N + contact.friction_N)});
}

bool Instruments::has_free_lumen(std::size_t instrument) const {
  if (rod(instrument).instrument().inner_radius_mm() == 0) return false;
  for (std::size_t inner = instrument + 1; inner < count(); ++inner)
    if (!is_drawn_back(inner)) return false;
  return true;
}

std::optional<std::size_t> Instruments::free_lumen() const {
  for (std::size_t instrument = 0; instrument < count(); ++instrument)
    if (has_free_lumen(instrument)) return instrument;
  return std::nullopt;
}

void Instruments::exchange(std::size_t instrument, const InstrumentModel& model) {
  if (!is_drawn_back(instrument))
    throw InputError("{}: inserted by {:.4g} mm; draw it back to 0 before {} takes its place",
                     rod(instrument).instrument().name(), pose(instrument).insertion_mm, model.name());
  std::vector<InstrumentModel> instruments;
  for (std::size_t d = 0; d < count(); ++d)
    instruments.push_back(d == instrument ? model : rod(d).instrument());
  checked(tree_, end_, instruments);

  // The new one relaxes among copies of the others, which themselves stay as they are.
  CoaxialRods rods = rods_;
  rods.replace(instrument, make_rod(model));
  Walls walls(count());
  for (std::size_t d = 0; d < count(); ++d) {
    walls[d] = d == instrument ? make_wall(rods, d) : std::make_unique<WallContact>(*walls_[d]);
    rods.set_external(d, walls[d].get());
  }
  settle(rods);
  rods_.replace(instrument, rods.rod(instrument));
  walls_[instrument] = std::move(walls[instrument]);
  rods_.set_external(instrument, walls_[instrument].get());
  hubs_[instrument] = {};
  balloons_[instrument] = {.carries_stent = model.stent().has_value()};
}

// ---- balloons -------------------------------------------------------------------------------------------

double Instruments::balloon_radius_mm(std::size_t instrument) const {
  const InstrumentModel& model = rod(instrument).instrument();
  return model.balloon() ? model.balloon_radius_mm(balloon_bar(instrument)) : 0;
}

std::span<const YieldingWalls::Opening> Instruments::balloon_lengths(std::size_t instrument) const {
  if (balloon_bar(instrument) == 0) return {};
  return balloons_[instrument].place.lengths;
}

bool Instruments::is_balloon_out(std::size_t instrument) const {
  const BalloonModel& balloon = *rod(instrument).instrument().balloon();
  const double out_mm = std::min(pose(instrument).insertion_mm, rods_.bare_mm(instrument));
  return balloon.from_tip_mm + balloon.length_mm <= out_mm;
}

/// From the tip on, a millimetre after the other, so that each place is searched for from the last one.
Treatments::Place Instruments::place_of_balloon(std::size_t instrument) const {
  constexpr double kStep_mm = 1;
  const Rod& of = rod(instrument);
  const BalloonModel& balloon = *of.instrument().balloon();
  const LumenDistanceField& field = *treatments_.walls().field();
  const double last_mm = balloon.from_tip_mm + balloon.length_mm;
  Treatments::Place place;
  std::vector<YieldingWalls::Opening>& lengths = place.lengths;
  LumenDistanceField::SearchHint hint = wall(instrument).contacts().back().sample.hint;
  std::size_t node = of.node_count() - 1;
  const auto steps = static_cast<int>(std::ceil(last_mm / kStep_mm));
  for (int i = 0; i <= steps; ++i) {
    const double from_tip_mm = std::min(kStep_mm * i, last_mm);
    while (node > 1 && of.from_tip_mm(node - 1) < from_tip_mm) --node;
    const double to_mm = of.from_tip_mm(node), from_mm = of.from_tip_mm(node - 1);
    const double share = (from_tip_mm - to_mm) / (from_mm - to_mm);
    Eigen::Vector3d place_mm =
        of.state().nodes_mm[node] + share * (of.state().nodes_mm[node - 1] - of.state().nodes_mm[node]);
    if (body_) place_mm = Eigen::Vector3d(body_->place(place_mm).scan_mm.data());
    const LumenDistanceField::Sample sample = field.at(place_mm, hint);
    hint = sample.hint;
    if (from_tip_mm < balloon.from_tip_mm) continue;
    if (from_tip_mm <= balloon.middle_from_tip_mm()) {
      place.middle_branch = hint.branch;
      place.middle_mm = sample.arc_length_mm;
    }
    if (lengths.empty() || lengths.back().branch != hint.branch)
      lengths.push_back({hint.branch, sample.arc_length_mm, sample.arc_length_mm, 0});
    lengths.back().from_mm = std::min(lengths.back().from_mm, sample.arc_length_mm);
    lengths.back().to_mm = std::max(lengths.back().to_mm, sample.arc_length_mm);
  }
  return place;
}

/// Keeps the place of a balloon that has hardly moved, so that walls rest with it.
void Instruments::place_balloon(std::size_t instrument) {
  Treatments::Place place = place_of_balloon(instrument);
  Treatments::Place& last = balloons_[instrument].place;
  const auto is_near = [](const YieldingWalls::Opening& a, const YieldingWalls::Opening& b) {
    return a.branch == b.branch && std::abs(a.from_mm - b.from_mm) < kBalloonMoves_mm &&
           std::abs(a.to_mm - b.to_mm) < kBalloonMoves_mm;
  };
  if (!std::equal(place.lengths.begin(), place.lengths.end(), last.lengths.begin(), last.lengths.end(),
                  is_near))
    last = std::move(place);
  for (YieldingWalls::Opening& length : last.lengths) length.radius_mm = balloon_radius_mm(instrument);
}

std::optional<WallContact::Balloon> Instruments::balloon_on_wall(std::size_t instrument) const {
  const double bar = balloon_bar(instrument), radius_mm = balloon_radius_mm(instrument);
  if (bar == 0) return {};
  const BalloonModel& balloon = *rod(instrument).instrument().balloon();
  return WallContact::Balloon{
      .from_mm = balloon.from_tip_mm,
      .to_mm = balloon.from_tip_mm + balloon.length_mm,
      .radius_mm = radius_mm,
      .pressing_N_mm = kPressingShare * kNewtonPerMm2PerBar * bar * 2 * std::numbers::pi * radius_mm};
}

void Instruments::work_balloons() {
  std::vector<Treatments::Filled> filled;
  bool has_changed = false;
  for (std::size_t d = 0; d < count(); ++d) {
    const InstrumentModel& model = rod(d).instrument();
    if (!model.balloon()) continue;
    const double bar = is_balloon_out(d) ? pose(d).inflation_bar : 0;
    BalloonState& state = balloons_[d];
    has_changed = has_changed || bar != state.bar;
    state.bar = bar;
    state.opens_stent =
        state.opens_stent || (state.carries_stent && bar >= model.balloon()->chart.front().bar);
    if (bar == 0 && state.opens_stent) state.carries_stent = state.opens_stent = false;
    if (bar == 0) continue;
    place_balloon(d);
    filled.push_back({d, &model.name(), bar, state.place, state.opens_stent ? &*model.stent() : nullptr});
  }
  if (!has_changed && filled.empty()) return;
  const std::size_t stents_before = treatments_.stents().size();
  const bool yields = treatments_.work(filled, time_s());
  if (yields || treatments_.stents().size() != stents_before) ++vessel_changes_;
  if (!yields && !has_changed) return;
  for (std::size_t d = 0; d < count(); ++d)
    walls_[d]->take_walls(treatments_.walls().field(), balloon_on_wall(d), rod(d));
}

double Instruments::energy_J() const {
  double energy = rods_.energy_J();
  for (const auto& wall : walls_) energy += wall->energy_J();
  return energy;
}

}  // namespace xraycast
