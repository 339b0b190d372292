#include "xraycast/scene/map_motion.hpp"

#include "xraycast/casting/key_maps.hpp"
#include "xraycast/scene/same_scan.hpp"

namespace xraycast {

std::shared_ptr<const Motion> motion_of(const BodyMap& map, const std::filesystem::path& given,
                                        std::vector<std::string>& notes) {
  if (!map.keys) return nullptr;
  const std::filesystem::path file = given.empty() ? map.keys->motion : given;
  if (given.empty() && !std::filesystem::exists(file)) {
    notes.emplace_back(
        "the vessels stay where they are at phase 0 of the map's motion; give `motion`, by which it was "
        "cast, "
        "to move them too");
    return nullptr;
  }
  auto motion = std::make_shared<const Motion>(read_motion(file));
  check_same_modes(map, *motion);
  notes.insert(notes.end(), motion->warnings().begin(), motion->warnings().end());
  return motion;
}

}  // namespace xraycast
