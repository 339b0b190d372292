#include "xraycast/coaxial/treatment.hpp"

#include "xraycast/catheter/lumen_profile.hpp"

#include <algorithm>

namespace xraycast {

namespace {

double recoiled_mm(double radius_mm) { return (1 - YieldingWalls::kElasticStrain) * radius_mm; }

}  // namespace

Malapposition malapposition(const PlacedStent& stent, const LumenDistanceField& walls) {
  constexpr int kPlaces = 100;
  Malapposition found;
  for (int i = 0; i <= kPlaces; ++i) {
    const double arc_mm = stent.from_mm() + i * stent.length_mm() / kPlaces;
    const double outside_mm = stent.radius_mm + 0.5 * stent.model.strut_mm;
    const double away_mm = std::max(0.0, radius_mm(walls, stent.branch, arc_mm) - outside_mm);
    found.largest_mm = std::max(found.largest_mm, away_mm);
    if (away_mm > Malapposition::kNoticed_mm) found.share += 1.0 / (kPlaces + 1);
  }
  return found;
}

/// The one that goes on, or a new one.
Treatment& Treatments::of(const Filled& balloon, double time_s) {
  for (Treatment& treatment : list_)
    if (!treatment.is_over && treatment.instrument == balloon.instrument) return treatment;
  before_.push_back(walls_.field());
  occludes_.push_back(false);
  return list_.emplace_back(Treatment{
      .instrument = balloon.instrument, .device = *balloon.device, .from_s = time_s, .to_s = time_s});
}

void Treatments::place(Treatment& treatment, const Filled& balloon, const LumenDistanceField& before) const {
  const auto is_shorter = [](const YieldingWalls::Opening& a, const YieldingWalls::Opening& b) {
    return a.to_mm - a.from_mm < b.to_mm - b.from_mm;
  };
  const YieldingWalls::Opening& longest =
      *std::max_element(balloon.place.lengths.begin(), balloon.place.lengths.end(), is_shorter);
  constexpr double kBeyond_mm = Treatment::kReference_mm;
  treatment.largest_bar = balloon.bar;
  if (balloon.stent) treatment.stent = *balloon.stent;
  treatment.branch = longest.branch;
  treatment.from_mm = longest.from_mm;
  treatment.to_mm = longest.to_mm;
  treatment.middle_mm = balloon.place.middle_branch == longest.branch
                            ? balloon.place.middle_mm
                            : 0.5 * (longest.from_mm + longest.to_mm);
  treatment.opened_mm = 2 * longest.radius_mm;
  treatment.least_before_mm = 2 * least_radius_mm(before, longest.branch, longest.from_mm, longest.to_mm);
  const double length_mm = before.arc_length_mm(longest.branch);
  const double first_mm = std::max(0.0, longest.from_mm - kBeyond_mm),
               last_mm = std::min(length_mm, longest.to_mm + kBeyond_mm);
  treatment.reference_mm =
      radius_mm(before, longest.branch, first_mm) + radius_mm(before, longest.branch, last_mm);
  treatment.off_narrowest_mm =
      treatment.middle_mm - narrowest_at_mm(before, longest.branch, first_mm, last_mm);
}

/// What was left before is opened further by a balloon about its middle.
void Treatments::open_stents(std::span<const Filled> balloons) {
  for (PlacedStent& stent : stents_)
    for (const Filled& balloon : balloons)
      for (const YieldingWalls::Opening& length : balloon.place.lengths)
        if (length.branch == stent.branch && length.from_mm <= stent.middle_mm &&
            stent.middle_mm <= length.to_mm)
          stent.radius_mm = std::min(0.5 * stent.model.widest_mm(),
                                     std::max(stent.radius_mm, recoiled_mm(length.radius_mm)));
}

std::vector<YieldingWalls::Opening> Treatments::openings_of(std::span<const Filled> balloons) const {
  std::vector<YieldingWalls::Opening> openings;
  for (const Filled& balloon : balloons)
    openings.insert(openings.end(), balloon.place.lengths.begin(), balloon.place.lengths.end());
  for (const PlacedStent& stent : stents_)
    openings.push_back({stent.branch, stent.from_mm(), stent.to_mm(), stent.radius_mm});
  return openings;
}

/// The balloon is folded: a stent that it opened stays.
void Treatments::end(Treatment& treatment) {
  treatment.is_over = true;
  if (!treatment.stent) return;
  const PlacedStent& stent =
      stents_.emplace_back(PlacedStent{.model = *treatment.stent,
                                       .branch = treatment.branch,
                                       .middle_mm = treatment.middle_mm,
                                       .radius_mm = recoiled_mm(0.5 * treatment.opened_mm),
                                       .treatment = number_of(treatment)});
  treatment.stent_mm = 2 * stent.radius_mm;
  treatment.stent_length_mm = stent.length_mm();
}

/// Any of the vessels that it lies in, as the walls are now.
bool Treatments::fills(const Filled& balloon) const {
  return std::any_of(
      balloon.place.lengths.begin(), balloon.place.lengths.end(), [&](const YieldingWalls::Opening& length) {
        return length.radius_mm >=
               kFillsLumen * least_radius_mm(*walls_.field(), length.branch, length.from_mm, length.to_mm);
      });
}

bool Treatments::work(std::span<const Filled> balloons, double time_s) {
  for (const Filled& balloon : balloons) {
    Treatment& treatment = of(balloon, time_s);
    if (balloon.bar > treatment.largest_bar) place(treatment, balloon, *before_[number_of(treatment)]);
  }
  open_stents(balloons);
  const std::size_t stents_before = stents_.size();
  std::vector<Treatment*> going_on;
  for (Treatment& treatment : list_) {
    if (treatment.is_over) continue;
    going_on.push_back(&treatment);
    if (occludes_[number_of(treatment)]) treatment.occluded_s += time_s - treatment.to_s;
    treatment.to_s = time_s;
    const auto is_its = [&](const Filled& balloon) { return balloon.instrument == treatment.instrument; };
    if (std::none_of(balloons.begin(), balloons.end(), is_its)) end(treatment);
  }
  const bool moves = walls_.hold(openings_of(balloons));
  const LumenDistanceField& field = *walls_.field();
  for (Treatment* treatment : going_on)
    treatment->least_after_mm =
        2 * least_radius_mm(field, treatment->branch, treatment->from_mm, treatment->to_mm);
  for (const Filled& balloon : balloons) occludes_[number_of(of(balloon, time_s))] = fills(balloon);
  for (std::size_t s = stents_before; s < stents_.size(); ++s)
    list_[stents_[s].treatment].malapposition = malapposition(stents_[s], field);
  return moves;
}

}  // namespace xraycast
