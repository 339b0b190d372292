#include <iostream>
#include <xraycast/casting/caster.hpp>
#include <xraycast/phantom/phantom.hpp>

int main() {
  xraycast::ComputeDevice device;
  xraycast::Progress progress;
  const xraycast::Phantom sphere = xraycast::make_phantom("sphere", {.size = xraycast::Index3(48, 48, 32)});
  const xraycast::Volume volume = xraycast::generate(sphere, device, progress);
  const xraycast::MapGeometry geometry =
      xraycast::cylinder_map(volume.geometry(), 90, {0, 40, 80}, glm::dvec2(0, 0));
  const xraycast::BodyMap map =
      xraycast::cast(xraycast::upload(device, volume), geometry, xraycast::Opacity::paper(), progress).map;
  std::cout << "cast " << map.geometry.layers() << " layers of " << map.geometry.width << " x "
            << map.geometry.height << '\n';
}
