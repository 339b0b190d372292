// Advances a catheter up a phantom's aorta and prints the force and torque at its hub.
#include <iostream>
#include <xraycast/catheter/catheter.hpp>
#include <xraycast/phantom/phantom.hpp>

int main() {
  const xraycast::VesselTree tree(xraycast::make_phantom("thorax").vessel_branches(), "thorax");
  const xraycast::InstrumentModel cobra = xraycast::InstrumentModel::named("cobra-5f");
  xraycast::Catheter catheter(tree, cobra, xraycast::most_inferior_end(tree));

  xraycast::HubPose hub;
  while (hub.insertion_mm < 200) {
    hub.insertion_mm += 100 * catheter.step_s();  // 100 mm/s
    catheter.step(hub);
  }
  std::cout << "pushed 200 mm: the hub feels " << catheter.load().force_N << " N\n";
}
