#include "xraycast/trainer/trainer_setup.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/trainer/setup_numbers.hpp"

#include <algorithm>
#include <optional>
#include <string>

namespace xraycast {
namespace {

using Range = InstrumentSection::Range;

const char* const kName = "trainer";

Range range_of(SetupNumbers& numbers) {
  const double at_tip = numbers.real();
  return {at_tip, numbers.real()};
}

void add(const Range& range, std::vector<double>& numbers) {
  numbers.push_back(range.at_tip);
  numbers.push_back(range.at_hub);
}

void add_text(const std::string& text, std::vector<double>& numbers) {
  numbers.push_back(static_cast<double>(text.size()));
  for (const char byte : text) numbers.push_back(static_cast<unsigned char>(byte));
}

void add_tree(const VesselTree& tree, std::vector<double>& numbers) {
  numbers.push_back(static_cast<double>(tree.branches().size()));
  for (const VesselBranch& branch : tree.branches()) {
    numbers.push_back(branch.parent);
    add_text(branch.name, numbers);
    numbers.push_back(static_cast<double>(branch.points.size()));
    for (const VesselPoint& point : branch.points)
      for (const double number :
           {point.position_mm.x, point.position_mm.y, point.position_mm.z, point.radius_mm})
        numbers.push_back(number);
  }
}

void add_balloon(const std::optional<BalloonModel>& balloon, std::vector<double>& numbers) {
  numbers.push_back(balloon ? 1 : 0);
  if (!balloon) return;
  for (const double number : {balloon->diameter_mm, balloon->length_mm, balloon->from_tip_mm,
                              balloon->nominal_bar, balloon->rated_burst_bar})
    numbers.push_back(number);
  numbers.push_back(static_cast<double>(balloon->chart.size()));
  for (const BalloonModel::Size& size : balloon->chart) {
    numbers.push_back(size.bar);
    numbers.push_back(size.diameter_mm);
  }
}

void add_stent(const std::optional<StentModel>& stent, std::vector<double>& numbers) {
  numbers.push_back(stent ? 1 : 0);
  if (!stent) return;
  for (const double number :
       {stent->diameter_mm, stent->length_mm, double(stent->rings), double(stent->crowns),
        double(stent->links), stent->link_mm, stent->strut_mm, stent->from_tip_mm})
    numbers.push_back(number);
  numbers.push_back(static_cast<double>(stent->outward.size()));
  for (const StentModel::Force& force : stent->outward) {
    numbers.push_back(force.diameter_mm);
    numbers.push_back(force.outward_N_mm);
  }
}

void add_model(const InstrumentModel::Properties& p, std::vector<double>& numbers) {
  for (const double number : {p.radius_mm, p.inner_radius_mm, p.mass_per_length_g_mm, p.axial_stiffness_N,
                              p.static_friction, p.kinetic_friction})
    numbers.push_back(number);
  numbers.push_back(static_cast<double>(p.sections.size()));
  for (const InstrumentSection& section : p.sections) {
    numbers.push_back(section.length_mm);
    add(section.bending_stiffness_Nmm2, numbers);
    add(section.torsional_stiffness_Nmm2, numbers);
    add(section.curvature_per_mm, numbers);
    numbers.push_back(section.plane_rad);
  }
  const std::vector<std::string>& materials = marker_materials();
  numbers.push_back(static_cast<double>(p.markers.size()));
  for (const MarkerModel& marker : p.markers) {
    const auto material = std::find(materials.begin(), materials.end(), marker.material);
    numbers.push_back(static_cast<double>(material - materials.begin()));
    for (const double number : {marker.from_tip_mm, marker.length_mm, marker.thickness_mm})
      numbers.push_back(number);
  }
  add_balloon(p.balloon, numbers);
  add_stent(p.stent, numbers);
  numbers.push_back(static_cast<double>(p.coils.size()));
  for (const CoilModel& coil : p.coils)
    for (const double number : {coil.loop_mm, coil.length_mm, coil.wire_mm}) numbers.push_back(number);
}

std::string text_of(SetupNumbers& numbers) {
  constexpr int kMostByte = 255;
  std::string text(numbers.count(), ' ');
  for (char& byte : text) byte = static_cast<char>(static_cast<unsigned char>(numbers.whole(kMostByte)));
  return text;
}

std::shared_ptr<const VesselTree> tree_of(SetupNumbers& numbers) {
  std::vector<VesselBranch> branches(numbers.count());
  for (VesselBranch& branch : branches) {
    branch.parent = numbers.index();
    branch.name = text_of(numbers);
    branch.points.resize(numbers.count());
    for (VesselPoint& point : branch.points) {
      for (int axis = 0; axis < 3; ++axis) point.position_mm[axis] = numbers.real();
      point.radius_mm = numbers.real();
    }
  }
  return std::make_shared<const VesselTree>(std::move(branches), kName);
}

VesselEnd entry_of(const VesselTree& tree, SetupNumbers& numbers) {
  const int branch = numbers.index();
  const bool at_start = numbers.real() != 0;
  for (const VesselEnd& end : vessel_ends(tree))
    if (end.branch == branch && end.at_start == at_start) return end;
  throw InputError("{}: there is no end of branch {}", kName, branch);
}

std::optional<BalloonModel> balloon_of(SetupNumbers& numbers) {
  if (numbers.whole(1) == 0) return std::nullopt;
  BalloonModel balloon;
  for (double* number : {&balloon.diameter_mm, &balloon.length_mm, &balloon.from_tip_mm, &balloon.nominal_bar,
                         &balloon.rated_burst_bar})
    *number = numbers.real();
  balloon.chart.resize(numbers.count());
  for (BalloonModel::Size& size : balloon.chart) {
    size.bar = numbers.real();
    size.diameter_mm = numbers.real();
  }
  return balloon;
}

std::optional<StentModel> stent_of(SetupNumbers& numbers) {
  if (numbers.whole(1) == 0) return std::nullopt;
  constexpr int kMost = 1000;  // rings, or crowns of one
  StentModel stent;
  stent.diameter_mm = numbers.real();
  stent.length_mm = numbers.real();
  for (int* number : {&stent.rings, &stent.crowns, &stent.links}) *number = numbers.whole(kMost);
  for (double* number : {&stent.link_mm, &stent.strut_mm, &stent.from_tip_mm}) *number = numbers.real();
  stent.outward.resize(numbers.count());
  for (StentModel::Force& force : stent.outward) {
    force.diameter_mm = numbers.real();
    force.outward_N_mm = numbers.real();
  }
  return stent;
}

InstrumentModel model_of(SetupNumbers& numbers, const std::string& name) {
  InstrumentModel::Properties p;
  p.name = name;
  for (double* number : {&p.radius_mm, &p.inner_radius_mm, &p.mass_per_length_g_mm, &p.axial_stiffness_N,
                         &p.static_friction, &p.kinetic_friction})
    *number = numbers.real();
  p.sections.resize(numbers.count());
  for (InstrumentSection& section : p.sections) {
    section.length_mm = numbers.real();
    section.bending_stiffness_Nmm2 = range_of(numbers);
    section.torsional_stiffness_Nmm2 = range_of(numbers);
    section.curvature_per_mm = range_of(numbers);
    section.plane_rad = numbers.real();
  }
  const std::vector<std::string>& materials = marker_materials();
  p.markers.resize(numbers.count());
  for (MarkerModel& marker : p.markers) {
    const int material = numbers.whole(static_cast<int>(materials.size()) - 1);
    if (material < 0) throw InputError("{}: {} is no material", kName, material);
    marker.material = materials[static_cast<std::size_t>(material)];
    for (double* number : {&marker.from_tip_mm, &marker.length_mm, &marker.thickness_mm})
      *number = numbers.real();
  }
  p.balloon = balloon_of(numbers);
  p.stent = stent_of(numbers);
  p.coils.resize(numbers.count());
  for (CoilModel& coil : p.coils)
    for (double* number : {&coil.loop_mm, &coil.length_mm, &coil.wire_mm}) *number = numbers.real();
  return InstrumentModel(std::move(p), name);
}

}  // namespace

std::vector<InstrumentModel> TrainerSetup::instruments() const {
  std::vector<InstrumentModel> models;
  for (const std::size_t choice : used) models.push_back(choices[choice]);
  return models;
}

std::vector<double> packed(const TrainerSetup& setup) {
  std::vector<double> numbers;
  add_tree(*setup.tree, numbers);
  add_motion(setup.motion, numbers);
  const std::vector<double> use = packed_use(setup);
  numbers.insert(numbers.end(), use.begin(), use.end());
  return numbers;
}

std::vector<double> packed_use(const TrainerSetup& setup) {
  std::vector<double> numbers;
  numbers.push_back(setup.entry.branch);
  numbers.push_back(setup.entry.at_start ? 1 : 0);
  numbers.push_back(static_cast<double>(setup.choices.size()));
  for (const InstrumentModel& model : setup.choices) add_model(model.properties(), numbers);
  numbers.push_back(static_cast<double>(setup.used.size()));
  for (const std::size_t choice : setup.used) numbers.push_back(static_cast<double>(choice));
  add_text(setup.exercise, numbers);
  return numbers;
}

TrainerSetup trainer_setup_of(std::span<const double> packed) {
  SetupNumbers numbers(kName, packed);
  TrainerSetup setup;
  setup.tree = tree_of(numbers);
  setup.motion = page_motion_of(numbers);
  setup.entry = entry_of(*setup.tree, numbers);
  const std::size_t choices = numbers.count();
  for (std::size_t c = 0; c < choices; ++c)
    setup.choices.push_back(model_of(numbers, "instrument " + std::to_string(c)));
  setup.used.resize(numbers.count());
  for (std::size_t& choice : setup.used) {
    choice = static_cast<std::size_t>(numbers.index());
    if (choice >= choices) throw InputError("{}: there are {} instruments", kName, choices);
  }
  setup.exercise = text_of(numbers);
  return setup;
}

}  // namespace xraycast
