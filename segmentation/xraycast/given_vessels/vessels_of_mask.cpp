#include "xraycast/given_vessels/vessels_of_mask.hpp"

#include "xraycast/attenuation/materials.hpp"
#include "xraycast/given_vessels/one_component.hpp"
#include "xraycast/segmentation/surface.hpp"

#include <algorithm>

namespace xraycast {
namespace {

LumenFill full_fill(const Mask& mask) {
  LumenFill fill(mask.geometry);
  std::ranges::transform(mask.voxels, fill.fractions.begin(), [](std::uint8_t inside) {
    return static_cast<std::uint8_t>(inside != 0 ? LumenFill::kFull : 0);
  });
  return fill;
}

}  // namespace

Vessels vessels_of_mask(Mask mask, const Volume* scan, const GivenVesselsOptions& options,
                        const std::string& name, Progress& progress) {
  if (scan != nullptr) check_mask_grid(mask.geometry, scan->geometry(), name);
  std::vector<std::string> notes;
  mask = one_component(mask, options.component_mm, name, notes);
  LumenFill fill = scan != nullptr ? fill_of(*scan, mask) : full_fill(mask);
  Centrelines centrelines = extract_centrelines(mask, name, progress, options.root_mm, &fill);
  progress.begin("surface", 1, "surfaces");
  Mesh surface = surface_of(mask, fill, options.triangles);
  progress.advance();
  return {std::move(mask), std::move(fill), std::move(centrelines), std::move(surface), {}, 0,
          std::move(notes)};
}

}  // namespace xraycast
