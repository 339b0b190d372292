// Draws a frame of a body map without a display and writes it as PNG.
#include <iostream>
#include <xraycast/base/picture_file.hpp>
#include <xraycast/casting/caster.hpp>
#include <xraycast/drawing/headless_context.hpp>
#include <xraycast/drawing/renderer.hpp>
#include <xraycast/phantom/phantom.hpp>
#include <xraycast/sampling/c_arm_pose.hpp>

int main() {
  xraycast::ComputeDevice device;
  xraycast::Progress progress;
  const xraycast::Phantom thorax = xraycast::make_phantom("thorax", {.size = xraycast::Index3(96, 96, 64)});
  const xraycast::Volume volume = xraycast::generate(thorax, device, progress);
  const auto radii_mm = xraycast::shell_radii_mm(xraycast::RadiiRule::equal_area, 16, 200);
  const xraycast::MapGeometry geometry = xraycast::cylinder_map(volume.geometry(), 360, radii_mm, {0, 0});
  const auto map = std::make_shared<xraycast::BodyMap>(
      xraycast::cast(xraycast::upload(device, volume), geometry, xraycast::Opacity::paper(), progress).map);

  const xraycast::HeadlessContext context;
  xraycast::Renderer renderer;
  renderer.set_map(map);
  const xraycast::CArmPose pose{.lao_rad = 0.5};
  const xraycast::View view = xraycast::view_of(pose, xraycast::bounds_of(geometry), 480, 640);
  xraycast::write_picture(renderer.picture(view, {}), view.width, view.height, 3, "frame.png");
  std::cout << "drew " << view.width << " x " << view.height << " pixels\n";
}
