// Casts a body map of a phantom and writes it as OpenEXR.
#include <iostream>
#include <xraycast/casting/caster.hpp>
#include <xraycast/phantom/phantom.hpp>

int main() {
  xraycast::ComputeDevice device;
  xraycast::Progress progress;
  const xraycast::Phantom thorax = xraycast::make_phantom("thorax", {.size = xraycast::Index3(96, 96, 64)});
  const xraycast::Volume volume = xraycast::generate(thorax, device, progress);

  const auto radii_mm = xraycast::shell_radii_mm(xraycast::RadiiRule::equal_area, 8, 200);
  const xraycast::MapGeometry geometry = xraycast::cylinder_map(volume.geometry(), 360, radii_mm, {0, 0});
  const xraycast::BodyMap map =
      xraycast::cast(xraycast::upload(device, volume), geometry, xraycast::Opacity::paper(), progress).map;
  xraycast::write_body_map(map, "map.exr");
  std::cout << "cast " << map.geometry.layers() << " layers of " << map.geometry.width << " x "
            << map.geometry.height << '\n';
}
