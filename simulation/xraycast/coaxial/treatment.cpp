#include "xraycast/coaxial/treatment.hpp"

#include "xraycast/catheter/lumen_profile.hpp"
#include "xraycast/coaxial/self_expansion.hpp"

#include <algorithm>

namespace xraycast {

namespace {

double recoiled_mm(double radius_mm) { return (1 - YieldingWalls::kElasticStrain) * radius_mm; }

}  // namespace

/// The one that goes on, or a new one.
Treatment& Treatments::of(std::size_t instrument, const std::string& device, double time_s) {
  for (Treatment& treatment : list_)
    if (!treatment.is_over && treatment.instrument == instrument) return treatment;
  before_.push_back(walls_.field());
  occludes_.push_back(false);
  return list_.emplace_back(
      Treatment{.instrument = instrument, .device = device, .from_s = time_s, .to_s = time_s});
}

/// A balloon, at its largest pressure so far.
void Treatments::place(Treatment& treatment, const Filled& balloon) {
  const auto is_shorter = [](const YieldingWalls::Opening& a, const YieldingWalls::Opening& b) {
    return a.to_mm - a.from_mm < b.to_mm - b.from_mm;
  };
  const YieldingWalls::Opening& longest =
      *std::max_element(balloon.place.lengths.begin(), balloon.place.lengths.end(), is_shorter);
  treatment.largest_bar = balloon.bar;
  if (balloon.stent) treatment.stent = *balloon.stent;
  treatment.branch = longest.branch;
  treatment.from_mm = longest.from_mm;
  treatment.to_mm = longest.to_mm;
  treatment.middle_mm = balloon.place.middle_branch == longest.branch
                            ? balloon.place.middle_mm
                            : 0.5 * (longest.from_mm + longest.to_mm);
  treatment.opened_mm = 2 * longest.radius_mm;
  measure(treatment);
}

/// The vessel as it was before, where the treatment is.
void Treatments::measure(Treatment& treatment) const {
  constexpr double kBeyond_mm = Treatment::kReference_mm;
  const LumenDistanceField& before = *before_[number_of(treatment)];
  const int branch = treatment.branch;
  treatment.least_before_mm = 2 * least_radius_mm(before, branch, treatment.from_mm, treatment.to_mm);
  const double length_mm = before.arc_length_mm(branch);
  const double first_mm = std::max(0.0, treatment.from_mm - kBeyond_mm),
               last_mm = std::min(length_mm, treatment.to_mm + kBeyond_mm);
  treatment.reference_mm = radius_mm(before, branch, first_mm) + radius_mm(before, branch, last_mm);
  treatment.off_narrowest_mm = treatment.middle_mm - narrowest_at_mm(before, branch, first_mm, last_mm);
}

PlacedStent& Treatments::stent_of(const Treatment& treatment) {
  return *std::find_if(stents_.begin(), stents_.end(),
                       [&](const PlacedStent& stent) { return stent.treatment == number_of(treatment); });
}

/// Each next to the last one, as wide as the wall there lets it.
void Treatments::free_rings(Treatment& treatment, const Unsheathed& unsheathed) {
  if (!treatment.stent) {
    treatment.stent = *unsheathed.stent;
    treatment.branch = unsheathed.branch;
    stents_.push_back({.model = *treatment.stent, .branch = treatment.branch});
    stents_.back().treatment = number_of(treatment);
  }
  PlacedStent& stent = stent_of(treatment);
  while (static_cast<int>(stent.radii_mm.size()) < unsheathed.free_rings) free_ring(stent, unsheathed);
  stent.middle_mm = unsheathed.far_end_mm + unsheathed.towards_hub * 0.5 * stent.length_mm();
  treatment.from_mm = stent.from_mm();
  treatment.to_mm = stent.to_mm();
  treatment.middle_mm = stent.middle_mm;
  treatment.opened_mm = 2 * stent.mean_radius_mm();
  measure(treatment);
}

void Treatments::free_ring(PlacedStent& stent, const Unsheathed& unsheathed) const {
  // Its height follows from its radius, and where its middle is from its height, which changes by little.
  constexpr int kRounds = 4;
  const StentModel& model = stent.model;
  const LumenDistanceField& before = *before_[stent.treatment];
  const double from_far_end_mm = stent.radii_mm.empty() ? 0 : stent.length_mm() + model.link_mm;
  double free_mm = 0.5 * model.diameter_mm, vessel_mm = free_mm;
  for (int round = 0; round < kRounds; ++round) {
    const double middle_mm = from_far_end_mm + 0.5 * model.ring_height_mm(2 * free_mm);
    vessel_mm = radius_mm(before, stent.branch, unsheathed.far_end_mm + unsheathed.towards_hub * middle_mm);
    free_mm = expanded_radius_mm(model, vessel_mm);
  }
  const bool is_last = unsheathed.towards_hub > 0;
  stent.radii_mm.insert(is_last ? stent.radii_mm.end() : stent.radii_mm.begin(), free_mm);
  stent.vessel_mm.insert(is_last ? stent.vessel_mm.end() : stent.vessel_mm.begin(), vessel_mm);
}

/// What was left before: rings whose middles a balloon lies at.
void Treatments::open_stents(std::span<const Filled> balloons) {
  for (PlacedStent& stent : stents_)
    for (std::size_t ring = 0; ring < stent.radii_mm.size(); ++ring) {
      const double middle_mm = stent.ring_middle_mm(ring);
      for (const Filled& balloon : balloons)
        for (const YieldingWalls::Opening& length : balloon.place.lengths)
          if (length.branch == stent.branch && length.from_mm <= middle_mm && middle_mm <= length.to_mm)
            open_ring(stent, ring, recoiled_mm(length.radius_mm));
    }
}

/// By a balloon that leaves so much. A ring that opens itself finds a wider vessel then.
void Treatments::open_ring(PlacedStent& stent, std::size_t ring, double left_mm) {
  double& radius_mm = stent.radii_mm[ring];
  if (!stent.model.expands_itself()) {
    radius_mm = std::min(0.5 * stent.model.widest_mm(), std::max(radius_mm, left_mm));
  } else if (left_mm > stent.vessel_mm[ring]) {
    stent.vessel_mm[ring] = left_mm;
    radius_mm = expanded_radius_mm(stent.model, left_mm);
  }
}

std::vector<YieldingWalls::Opening> Treatments::openings_of(std::span<const Filled> balloons) const {
  std::vector<YieldingWalls::Opening> openings;
  for (const Filled& balloon : balloons)
    openings.insert(openings.end(), balloon.place.lengths.begin(), balloon.place.lengths.end());
  for (const PlacedStent& stent : stents_)
    for (const YieldingWalls::Opening& ring : stent.openings()) openings.push_back(ring);
  return openings;
}

/// Any of the vessels that it lies in, as the walls are now.
bool Treatments::fills(const Filled& balloon) const {
  const auto is_filled = [&](const YieldingWalls::Opening& length) {
    return length.radius_mm >=
           kFillsLumen * least_radius_mm(*walls_.field(), length.branch, length.from_mm, length.to_mm);
  };
  return std::any_of(balloon.place.lengths.begin(), balloon.place.lengths.end(), is_filled);
}

bool Treatments::goes_on(const Treatment& treatment, std::span<const Filled> balloons) {
  if (treatment.is_release())
    return static_cast<int>(stent_of(treatment).radii_mm.size()) < treatment.stent->rings;
  return std::any_of(balloons.begin(), balloons.end(),
                     [&](const Filled& balloon) { return balloon.instrument == treatment.instrument; });
}

/// The balloon is folded, and a stent that it opened stays; or all of a stent is free.
void Treatments::end(Treatment& treatment) {
  treatment.is_over = true;
  if (!treatment.stent || treatment.is_release()) return;
  const auto rings = static_cast<std::size_t>(treatment.stent->rings);
  stents_.push_back({.model = *treatment.stent,
                     .branch = treatment.branch,
                     .middle_mm = treatment.middle_mm,
                     .radii_mm = std::vector<double>(rings, recoiled_mm(0.5 * treatment.opened_mm))});
  stents_.back().treatment = number_of(treatment);
}

/// What became of a stent, as the walls are now.
void Treatments::tell(const PlacedStent& stent) {
  Treatment& treatment = list_[stent.treatment];
  const auto rings = static_cast<double>(stent.radii_mm.size());
  treatment.stent_mm = 2 * stent.mean_radius_mm();
  treatment.stent_length_mm = stent.length_mm();
  treatment.malapposition = malapposition(stent, *walls_.field());
  treatment.sheathed_rings = stent.model.rings - static_cast<int>(stent.radii_mm.size());
  treatment.outward_N_mm = 0;
  for (const double radius_mm : stent.radii_mm)
    treatment.outward_N_mm += stent.model.outward_N_mm(2 * radius_mm) / rings;
}

bool Treatments::work(std::span<const Filled> balloons, std::span<const Unsheathed> stents, double time_s) {
  for (const Filled& balloon : balloons) {
    Treatment& treatment = of(balloon.instrument, *balloon.device, time_s);
    if (balloon.bar > treatment.largest_bar) place(treatment, balloon);
  }
  for (const Unsheathed& stent : stents) free_rings(of(stent.instrument, *stent.device, time_s), stent);
  open_stents(balloons);
  std::vector<std::size_t> going_on;
  for (Treatment& treatment : list_) {
    if (treatment.is_over) continue;
    going_on.push_back(number_of(treatment));
    if (occludes_[number_of(treatment)]) treatment.occluded_s += time_s - treatment.to_s;
    treatment.to_s = time_s;
    if (!goes_on(treatment, balloons)) end(treatment);
  }
  const bool moves = walls_.hold(openings_of(balloons));
  const LumenDistanceField& field = *walls_.field();
  for (const std::size_t number : going_on) {
    Treatment& treatment = list_[number];
    treatment.least_after_mm =
        2 * least_radius_mm(field, treatment.branch, treatment.from_mm, treatment.to_mm);
  }
  for (const Filled& balloon : balloons)
    occludes_[number_of(of(balloon.instrument, *balloon.device, time_s))] = fills(balloon);
  for (const PlacedStent& stent : stents_)
    if (std::find(going_on.begin(), going_on.end(), stent.treatment) != going_on.end()) tell(stent);
  return moves;
}

void Treatments::take_out(std::size_t instrument) {
  for (Treatment& treatment : list_)
    if (treatment.instrument == instrument) treatment.is_over = true;
}

}  // namespace xraycast
