#include "xraycast/lesions/vessel_folder.hpp"

#include "xraycast/attenuation/materials.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/image_file/fractions_file.hpp"
#include "xraycast/scan/scan.hpp"
#include "xraycast/segmentation/threshold.hpp"

#include <algorithm>

namespace xraycast {
namespace {

namespace fs = std::filesystem;

bool is_there(const fs::path& file) {
  std::error_code error;
  return fs::exists(file, error);
}

LumenFill fill_of_file(const fs::path& file, const Mask& mask) {
  LumenFill fill(mask.geometry);
  if (!is_there(file)) {
    std::ranges::transform(mask.voxels, fill.fractions.begin(), [](std::uint8_t inside) {
      return static_cast<std::uint8_t>(inside != 0 ? LumenFill::kFull : 0);
    });
    return fill;
  }
  Fractions fractions = read_fractions(file);
  check_mask_grid(fractions.geometry, mask.geometry, file.string());
  fill.fractions = std::move(fractions.values);
  return fill;
}

VoxelLumen read_lumen(const fs::path& folder, Progress& progress) {
  const fs::path file = folder / "mask.nrrd";
  const Scan scan = open_scan(file, {}, progress);
  Mask mask = between(collect(*scan.source, progress, file.string()), 1, kMaxHu);
  LumenFill fill = fill_of_file(folder / "lumen.nrrd", mask);
  return {std::move(mask), std::move(fill)};
}

}  // namespace

VesselFolder read_vessel_folder(const fs::path& path, Progress& progress) {
  VesselFolder found{read_tree(path), {}, {}};
  std::error_code error;
  if (!fs::is_directory(path, error)) return found;
  if (is_there(path / "surface.vtp")) found.surface = read_mesh(path / "surface.vtp");
  if (is_there(path / "mask.nrrd")) found.lumen = read_lumen(path, progress);
  return found;
}

}  // namespace xraycast
