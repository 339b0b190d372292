#include "xraycast/coaxial/instruments.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/mechanics/vectors.hpp"

#include <glm/matrix.hpp>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

namespace xraycast {
namespace {

// The straight sheath outside the tree through which instruments enter: its length.
constexpr double kIntroducer_mm = 20;

// Balloons and stents are worked on so often: at the fastest inflation balloons grow by some 0.05 mm in
// between.
constexpr long kTreatmentSteps = 10;
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

double max_insertion_mm(const InstrumentModel& model) {
  return model.length_mm() - kIntroducer_mm + model.longest_coil_mm();
}

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
  if (instruments.front().has_coils())
    throw InputError("{}: pushes coils through a catheter; give one before it, such as microcatheter-24f",
                     instruments.front().name());
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
      balloons_(instruments.size()),
      sheaths_(instruments.size()) {
  for (const AneurysmSac& sac : sacs_of(tree)) packs_.emplace_back(sac);
  for (const InstrumentModel& model : instruments) pushers_.emplace_back(model);
  for (std::size_t d = 0; d < count(); ++d)
    balloons_[d].carries_stent = instruments[d].balloon() && instruments[d].stent();
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
  return rod(instrument).instrument().length_mm() - kIntroducer_mm + pushers_[instrument].ahead_mm();
}

std::span<const double> Instruments::phases() const {
  return body_ ? std::span<const double>(body_->phases()) : std::span<const double>();
}

void Instruments::step(std::span<const HubPose> targets, std::span<const double> phases) {
  bool detaches = false;
  for (std::size_t d = 0; d < count(); ++d) {
    const double rotation_before_rad = pose(d).rotation_rad, detach_before = pose(d).detach;
    const HubPose largest{.insertion_mm = largest_insertion_mm(d),
                          .inflation_bar = rod(d).instrument().max_inflation_bar(),
                          .release_mm = rod(d).instrument().max_release_mm(),
                          .detach = rod(d).instrument().has_coils() ? CoilPusher::kMostDetached : 0};
    hubs_[d].approach(targets[d], load(d).force_N, largest, options_.step_s);
    if (pose(d).rotation_rad != rotation_before_rad) rods_.rotate_to(d, pose(d).rotation_rad);
    rods_.feed_to(d, kIntroducer_mm + rod_insertion_mm(d));
    pushers_[d].note(targets[d].insertion_mm, largest.insertion_mm, options_.step_s);
    detaches = detaches || std::floor(pose(d).detach) != std::floor(detach_before);
  }
  if (steps_ % kTreatmentSteps == 0) treat();
  if (steps_ % kTreatmentSteps == 0 || detaches) push_coils();  // at once: a script's last row may detach
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
  const CoilPusher& pusher = pushers_[instrument];
  const double coil_N = pusher.sac ? packs_[*pusher.sac].push_N() : 0;
  return {.force_N = -of.clamp_force_N().dot(of.clamp().axis) + coil_N, .torque_Nm = -of.clamp_torque_Nm()};
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
  balloons_[instrument] = {.carries_stent = model.balloon() && model.stent()};
  sheaths_[instrument] = {};
  pushers_[instrument] = CoilPusher(model);
  treatments_.take_out(instrument);
}

// ---- balloons and stents --------------------------------------------------------------------------------

int Instruments::carried_rings(std::size_t instrument) const {
  const InstrumentModel& model = rod(instrument).instrument();
  if (!model.stent()) return 0;
  if (model.has_sheath()) return model.stent()->rings - sheaths_[instrument].free_rings;
  return balloons_[instrument].carries_stent ? model.stent()->rings : 0;
}

double Instruments::balloon_radius_mm(std::size_t instrument) const {
  const InstrumentModel& model = rod(instrument).instrument();
  return model.balloon() ? model.balloon_radius_mm(balloon_bar(instrument)) : 0;
}

std::span<const YieldingWalls::Opening> Instruments::balloon_lengths(std::size_t instrument) const {
  if (balloon_bar(instrument) == 0) return {};
  return balloons_[instrument].place.lengths;
}

/// Beyond the introducer and the instruments around it, as far as to there.
bool Instruments::is_out(std::size_t instrument, double from_tip_mm) const {
  return from_tip_mm <= std::min(pose(instrument).insertion_mm, rods_.bare_mm(instrument));
}

/// Between two lengths from the tip, about a millimetre apart. From the tip on, so that each place is
/// searched for from the last one.
std::vector<Instruments::AxisPlace> Instruments::axis_places(std::size_t instrument, double first_mm,
                                                             double last_mm) const {
  constexpr double kStep_mm = 1;
  const Rod& of = rod(instrument);
  const LumenDistanceField& field = *treatments_.walls().field();
  std::vector<AxisPlace> places;
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
    if (from_tip_mm >= first_mm) places.push_back({from_tip_mm, hint.branch, sample.arc_length_mm});
  }
  return places;
}

Treatments::Place Instruments::place_of_balloon(std::size_t instrument) const {
  const BalloonModel& balloon = *rod(instrument).instrument().balloon();
  Treatments::Place place;
  std::vector<YieldingWalls::Opening>& lengths = place.lengths;
  for (const auto& [from_tip_mm, branch, arc_mm] :
       axis_places(instrument, balloon.from_tip_mm, balloon.from_tip_mm + balloon.length_mm)) {
    if (from_tip_mm <= balloon.middle_from_tip_mm()) {
      place.middle_branch = branch;
      place.middle_mm = arc_mm;
    }
    if (lengths.empty() || lengths.back().branch != branch) lengths.push_back({branch, arc_mm, arc_mm, 0});
    lengths.back().from_mm = std::min(lengths.back().from_mm, arc_mm);
    lengths.back().to_mm = std::max(lengths.back().to_mm, arc_mm);
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

/// Where a stent is as its first ring is free: in the vessel that most of it is in, whose far end follows
/// from the part of it that is nearest to the tip.
void Instruments::place_stent(std::size_t instrument) {
  const InstrumentModel& model = rod(instrument).instrument();
  const double first_mm = model.stent()->from_tip_mm;
  const std::vector<AxisPlace> places = axis_places(instrument, first_mm, first_mm + model.max_release_mm());
  std::map<int, std::size_t> counts;
  for (const AxisPlace& place : places) ++counts[place.branch];
  SheathState& state = sheaths_[instrument];
  std::size_t most = 0;
  for (const auto& [branch, count] : counts)
    if (count > most) {
      most = count;
      state.branch = branch;
    }
  const auto is_in = [&](const AxisPlace& place) { return place.branch == state.branch; };
  const AxisPlace& nearest = *std::find_if(places.begin(), places.end(), is_in);
  const AxisPlace& furthest = *std::find_if(places.rbegin(), places.rend(), is_in);
  state.towards_hub = furthest.arc_mm >= nearest.arc_mm ? 1 : -1;
  state.far_end_mm = nearest.arc_mm - state.towards_hub * (nearest.from_tip_mm - first_mm);
}

/// From which the sheath is drawn back.
int Instruments::uncovered_rings(std::size_t instrument) const {
  // A ring slips out of the last tenth of a millimetre, so that a hub's motion needs no more decimals.
  constexpr double kSlips_mm = 0.1;
  const InstrumentModel& model = rod(instrument).instrument();
  const StentModel& stent = *model.stent();
  const double ring_mm = stent.ring_height_mm(model.crimped_mm());
  return static_cast<int>((pose(instrument).release_mm + stent.link_mm + kSlips_mm) /
                          (ring_mm + stent.link_mm));
}

/// Stents of which rings became free.
std::vector<Treatments::Unsheathed> Instruments::draw_sheaths() {
  std::vector<Treatments::Unsheathed> unsheathed;
  for (std::size_t d = 0; d < count(); ++d) {
    const InstrumentModel& model = rod(d).instrument();
    if (!model.has_sheath() || !is_out(d, model.stent()->from_tip_mm + model.max_release_mm())) continue;
    SheathState& state = sheaths_[d];
    const int free_rings = std::min(uncovered_rings(d), model.stent()->rings);
    if (free_rings <= state.free_rings) continue;
    if (state.free_rings == 0) place_stent(d);
    state.free_rings = free_rings;
    unsheathed.push_back(
        {d, &model.name(), &*model.stent(), free_rings, state.branch, state.far_end_mm, state.towards_hub});
  }
  return unsheathed;
}

/// Those that are filled; and whether a pressure has changed.
std::vector<Treatments::Filled> Instruments::fill_balloons(bool& has_changed) {
  std::vector<Treatments::Filled> filled;
  for (std::size_t d = 0; d < count(); ++d) {
    const InstrumentModel& model = rod(d).instrument();
    if (!model.balloon()) continue;
    const bool is_free = is_out(d, model.balloon()->from_tip_mm + model.balloon()->length_mm);
    const double bar = is_free ? pose(d).inflation_bar : 0;
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
  return filled;
}

void Instruments::treat() {
  bool has_changed = false;
  const std::vector<Treatments::Filled> filled = fill_balloons(has_changed);
  const std::vector<Treatments::Unsheathed> unsheathed = draw_sheaths();
  if (!has_changed && filled.empty() && unsheathed.empty()) return;
  const std::size_t stents_before = treatments_.stents().size();
  const bool yields = treatments_.work(filled, unsheathed, time_s());
  if (yields || treatments_.stents().size() != stents_before || !unsheathed.empty()) ++vessel_changes_;
  if (!yields && !has_changed) return;
  for (std::size_t d = 0; d < count(); ++d)
    walls_[d]->take_walls(treatments_.walls().field(), balloon_on_wall(d), rod(d));
}

// ---- coils ----------------------------------------------------------------------------------------------

/// Of those around an instrument, of which there is one.
std::size_t Instruments::furthest_around(std::size_t instrument) const {
  std::size_t furthest = 0;
  for (std::size_t outer = 1; outer < instrument; ++outer)
    if (rod(outer).fed_mm() > rod(furthest).fed_mm()) furthest = outer;
  return furthest;
}

/// In which a tip lies, so that a coil has room there.
std::optional<std::size_t> Instruments::sac_at_tip(std::size_t instrument, double wire_mm) const {
  const glm::dvec3 place_mm = tip(instrument).scan_mm;
  for (std::size_t s = 0; s < packs_.size(); ++s)
    if (packs_[s].sac().radius_mm >= CoilPack::least_radius_mm(wire_mm) &&
        packs_[s].sac().depth_mm(place_mm) >= 0.5 * wire_mm)
      return s;
  return {};
}

/// A coil is pushed until all of it is out, and not out of a catheter whose tip is in no sac.
double Instruments::largest_insertion_mm(std::size_t instrument) const {
  const CoilPusher& pusher = pushers_[instrument];
  const double most_mm = max_insertion_mm(instrument);
  if (!pusher.has_coils()) return most_mm;
  const double around_mm = pose(furthest_around(instrument)).insertion_mm;
  if (pusher.is_attached && pusher.sac && !pusher.is_in_sac) return pose(instrument).insertion_mm;
  if (pusher.is_attached && !pusher.is_in_sac) return std::min(most_mm, around_mm);
  return std::min(most_mm, around_mm + pusher.ahead_mm());
}

/// Of its rod, behind the coil.
double Instruments::rod_insertion_mm(std::size_t instrument) const {
  return std::max(0.0, pose(instrument).insertion_mm - pushers_[instrument].ahead_mm());
}

void Instruments::push_coil(std::size_t instrument) {
  CoilPusher& pusher = pushers_[instrument];
  if (!pusher.is_attached) {
    pusher.refuse_detaching(pose(instrument).detach, 0, time_s());
    if (is_drawn_back(instrument)) pusher.take_next();
    return;
  }
  const std::size_t around = furthest_around(instrument);
  const double out_mm = pose(instrument).insertion_mm - pose(around).insertion_mm;
  const std::optional<std::size_t> sac = sac_at_tip(around, pusher.coil().wire_mm);
  if (!pusher.sac && sac && out_mm > 0 && !packs_[*sac].has_attached()) {
    const InstrumentTip from = tip(around);
    packs_[*sac].begin({.model = pusher.coil(),
                        .instrument = instrument,
                        .device = rod(instrument).instrument().name(),
                        .from_s = time_s()},
                       from.scan_mm, from.direction);
    pusher.sac = sac;
  }
  pusher.is_in_sac = pusher.sac ? sac == pusher.sac : sac && !packs_[*sac].has_attached();
  if (!pusher.sac) {
    pusher.refuse_detaching(pose(instrument).detach, 0, time_s());
    return;
  }
  CoilPack& pack = packs_[*pusher.sac];
  const double laid_mm = pack.coils().back().laid_mm;
  const double most_mm = pusher.is_in_sac ? pusher.coil().length_mm : laid_mm;
  const double now_mm = std::clamp(out_mm, 0.0, most_mm);
  if (now_mm != laid_mm) {
    pack.lay_to(now_mm);
    ++coil_changes_;
  }
  if (now_mm <= 0) {
    pusher.sac.reset();
  } else if (pusher.detaches(pose(instrument).detach, now_mm, time_s())) {
    pack.detach(time_s());
    pusher.sac.reset();
    ++coil_changes_;
  }
}

std::optional<PushedCoil> Instruments::pushed_coil(std::size_t instrument) const {
  const CoilPusher& pusher = pushers_[instrument];
  if (!pusher.is_attached) return {};
  const std::size_t around = furthest_around(instrument);
  return PushedCoil{.model = pusher.coil(),
                    .around = around,
                    .out_mm = pose(instrument).insertion_mm - pose(around).insertion_mm,
                    .laid_mm = pusher.sac ? packs_[*pusher.sac].coils().back().laid_mm : 0,
                    .is_in_sac = pusher.is_in_sac};
}

void Instruments::push_coils() {
  for (std::size_t d = 0; d < count(); ++d)
    if (pushers_[d].has_coils()) push_coil(d);
}

double Instruments::energy_J() const {
  double energy = rods_.energy_J();
  for (const auto& wall : walls_) energy += wall->energy_J();
  return energy;
}

}  // namespace xraycast
