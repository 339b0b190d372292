// A vessel tree and a catheter of one's own: the catheter is pushed up a trunk that forks, and turned into a
// branch.
#include <array>
#include <iostream>
#include <numbers>
#include <xraycast/coaxial/instruments.hpp>

// Centrelines as x, y, z and radius in mm: x grows to the patient's left, y to the back, z to the head. A
// branch begins at its parent's last point.
xraycast::VesselTree own_tree() {
  xraycast::VesselBranch trunk{.points = {{{0, 0, 0}, 4}, {{0, 2, 60}, 5}, {{0, 0, 120}, 6}}};
  xraycast::VesselBranch left{.points = {{{0, 0, 120}, 6}, {{8, 0, 150}, 5}, {{12, 0, 220}, 5}}, .parent = 0};
  xraycast::VesselBranch right{.points = {{{0, 0, 120}, 6}, {{-25, 0, 145}, 3}, {{-50, 0, 165}, 3}},
                               .parent = 0};
  return {{trunk, left, right}, "own tree"};
}

// Sections from the tip on. A file of this text is what --device-model takes too.
constexpr char kCatheter[] = R"({
  "name": "bent-4f", "radius_mm": 0.667, "inner_radius_mm": 0.45, "density_g_cm3": 1.2,
  "axial_stiffness_N": 200, "static_friction": 0.1, "kinetic_friction": 0.08,
  "sections": [
    {"length_mm": 12, "bending_stiffness_Nmm2": 20, "torsional_stiffness_Nmm2": 30, "curvature_per_mm": 0.06},
    {"length_mm": 20, "bending_stiffness_Nmm2": [20, 90], "torsional_stiffness_Nmm2": [30, 300]},
    {"length_mm": 768, "flexural_modulus_GPa": 0.7, "torsional_stiffness_Nmm2": 300}]
})";

int main() {
  const xraycast::VesselTree tree = own_tree();
  const auto catheter = xraycast::InstrumentModel::from_json(kCatheter, "bent-4f");
  for (const double turn_deg : {0, 90, 180, 270}) {
    xraycast::Instruments instruments(tree, {catheter}, xraycast::most_inferior_end(tree));
    std::array<xraycast::HubPose, 1> hubs;  // one an instrument
    hubs[0].rotation_rad = turn_deg * std::numbers::pi / 180;
    while (hubs[0].insertion_mm < 160) {
      hubs[0].insertion_mm += 80 * instruments.step_s();  // 80 mm/s
      instruments.step(hubs);
    }
    const xraycast::InstrumentTip tip = instruments.tip(0);
    std::cout << "turned by " << turn_deg << " deg: the tip is " << tip.arc_length_mm << " mm along branch "
              << tip.branch << '\n';
  }
}
