// Advances a catheter up a phantom's aorta and prints the force and torque at its hub.
#include <array>
#include <iostream>
#include <xraycast/coaxial/instruments.hpp>
#include <xraycast/phantom/phantom.hpp>

int main() {
  const xraycast::VesselTree tree(xraycast::make_phantom("thorax").vessel_branches(), "thorax");
  const xraycast::InstrumentModel cobra = xraycast::InstrumentModel::named("cobra-5f");
  xraycast::Instruments instruments(tree, {cobra}, xraycast::most_inferior_end(tree));

  std::array<xraycast::HubPose, 1> hubs;  // one an instrument
  while (hubs[0].insertion_mm < 200) {
    hubs[0].insertion_mm += 100 * instruments.step_s();  // 100 mm/s
    instruments.step(hubs);
  }
  std::cout << "pushed 200 mm: the hub feels " << instruments.load(0).force_N << " N\n";
}
