#include "xraycast/registration/scan_stack.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/picture_file.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

namespace xraycast {

Volume read_stack(const std::filesystem::path& path, const glm::dvec3& spacing_mm, Progress& progress) {
  if (!std::filesystem::is_regular_file(path)) throw InputError("{}: no such file", path.string());
  constexpr int kMostPages = 4096;
  std::vector<std::int16_t> voxels;
  VolumeGeometry geometry{.size = {0, 0, 0}, .spacing_mm = spacing_mm, .origin_mm = {0, 0, 0}};
  progress.begin("reading", 1, "stack");
  for (bool has_next = true; has_next; ++geometry.size.z) {
    progress.check();
    const FloatPicture page = read_grey_picture(path, static_cast<int>(geometry.size.z));
    if (geometry.size.z == 0)
      geometry.size = {page.width, page.height, 0};
    else if (page.width != geometry.size.x || page.height != geometry.size.y)
      throw InputError("{}: page {} has another size than the first", path.string(), geometry.size.z + 1);
    for (const float grey : page.grey)
      voxels.push_back(static_cast<std::int16_t>(std::lround(std::clamp(
          std::isfinite(grey) ? grey : 0.F, static_cast<float>(kPaddingHu), static_cast<float>(kMaxHu)))));
    has_next = page.has_next;
    if (has_next && geometry.size.z + 1 == kMostPages)
      throw InputError("{}: has more than {} pages", path.string(), kMostPages);
  }
  Volume volume(geometry, path.string());
  std::ranges::copy(voxels, volume.hu().begin());
  progress.advance();
  return volume;
}

void mirror(Volume& volume) {
  const auto row = static_cast<std::size_t>(volume.geometry().size.x);
  for (std::size_t first = 0; first < volume.hu().size(); first += row)
    std::ranges::reverse(volume.hu().subspan(first, row));
}

}  // namespace xraycast
