// Finds the vessels of a phantom and writes their tree for ParaView or 3D Slicer.
#include <iostream>
#include <xraycast/phantom/phantom.hpp>
#include <xraycast/segmentation/vessels.hpp>

int main() {
  xraycast::ComputeDevice device;
  xraycast::Progress progress;
  const xraycast::Phantom thorax =
      xraycast::make_phantom("thorax", {.size = xraycast::Index3(192, 192, 160)});
  const xraycast::Volume volume = xraycast::generate(thorax, device, progress);

  const xraycast::Vessels vessels = xraycast::find_vessels(volume, {}, "thorax", device, progress);
  const xraycast::VesselTree& tree = vessels.centrelines.tree;
  xraycast::write_tree(tree, "tree.vtp");
  std::cout << "found " << tree.branches().size() << " branches\n";
}
