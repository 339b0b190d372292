#pragma once

#include "xraycast/geometry/vessel_tree.hpp"

#include <string>
#include <vector>

namespace xraycast {

/// Names of the arteries of a trunk by their shape and place, one for each branch, empty where they are not
/// sure. Coordinates are a patient's (LPS), wherever their zero is and the tree begins.
///
/// The aorta is the widest way through the tree that runs down the body, to where it splits to both sides.
/// It is taken for an aorta only if it has an arch with vessels for the head, or branches to the front that
/// run as the coeliac trunk or the superior mesenteric artery do: a vena cava has neither. Its branches are
/// the three of the arch, the coeliac trunk with the hepatic and the splenic artery, the superior mesenteric
/// artery, the renal arteries and the iliac arteries, each by where it leaves and where it goes. What lies
/// beyond them has no name.
std::vector<std::string> artery_names(const VesselTree& tree);

/// The tree with these names, unless a branch has one already.
VesselTree with_artery_names(const VesselTree& tree);

}  // namespace xraycast
