// Where and how hard a catheter touches the wall while it is pushed up a phantom's aorta.
#include <glm/geometric.hpp>

#include <array>
#include <iostream>
#include <vector>
#include <xraycast/coaxial/instruments.hpp>
#include <xraycast/phantom/phantom.hpp>

int main() {
  const xraycast::VesselTree tree(xraycast::make_phantom("thorax").vessel_branches(), "thorax");
  const xraycast::InstrumentModel cobra = xraycast::InstrumentModel::named("cobra-5f");
  xraycast::Instruments instruments(tree, {cobra}, xraycast::most_inferior_end(tree));

  std::array<xraycast::HubPose, 1> hubs;
  std::vector<xraycast::InstrumentContact> contacts;
  xraycast::InstrumentContact hardest;
  for (int step = 0; step < 3000; ++step) {              // of a millisecond
    hubs[0].insertion_mm += 100 * instruments.step_s();  // 100 mm/s
    instruments.step(hubs);
    instruments.copy_contacts(0, contacts);
    for (const xraycast::InstrumentContact& contact : contacts)
      if (glm::length(contact.force_N) > glm::length(hardest.force_N)) hardest = contact;
  }

  std::cout << contacts.size() << " contacts after " << instruments.pose(0).insertion_mm
            << " mm, those of 0.04 N or more:\n";
  for (const auto& [position_mm, force_N] : contacts)
    if (glm::length(force_N) >= 0.04)
      std::cout << "  at " << position_mm.x << ' ' << position_mm.y << ' ' << position_mm.z << " mm with "
                << glm::length(force_N) << " N\n";
  const xraycast::VesselTree::Location place = tree.nearest(hardest.position_mm);
  std::cout << "the hardest of all: " << glm::length(hardest.force_N) << " N in branch " << place.branch
            << ", " << place.arc_length_mm << " mm along it\n";
}
