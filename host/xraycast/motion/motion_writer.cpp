#include "xraycast/motion/motion_writer.hpp"

#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/image_file/vector_image.hpp"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <utility>

namespace xraycast {
namespace {

FieldGrid field_grid_of(const VolumeGeometry& geometry) {
  const glm::dvec3& step_mm = geometry.spacing_mm;
  return {geometry.size, geometry.origin_mm, {step_mm.x, 0, 0, 0, step_mm.y, 0, 0, 0, step_mm.z}};
}

}  // namespace

void write_motion(const std::vector<ScaledMode>& modes, const std::filesystem::path& folder,
                  Progress& progress) {
  using Json = nlohmann::ordered_json;
  std::int64_t keys = 0;
  for (const ScaledMode& mode : modes) keys += std::ssize(mode.keys);
  progress.begin("writing the motion", keys, "fields");
  OutputSet outputs;
  Json described = Json::array();
  for (const ScaledMode& mode : modes) {
    Json phases = Json::array();
    for (const auto& [phase, share] : mode.keys) {
      progress.advance();
      if (share == 0) {
        phases.push_back({{"phase", phase}});
        continue;
      }
      std::vector<glm::vec3> field_mm = mode.field_mm;
      for (glm::vec3& d : field_mm) d *= static_cast<float>(share);
      const std::string file = fmt::format("{}_{:g}.nrrd", mode.name, phase);
      write_vector_image({field_grid_of(mode.nodes), std::move(field_mm)}, folder / file);
      phases.push_back({{"phase", phase}, {"field", file}});
    }
    Json one{{"name", mode.name}};
    if (mode.waveform.empty())
      one["period_s"] = mode.period_s;
    else
      one["waveform"] = mode.waveform;
    one["phases"] = phases;
    described.push_back(one);
  }
  write_whole_file(folder / "motion.json", Json{{"version", 1}, {"modes", described}}.dump(1) + "\n");
  outputs.commit();
}

}  // namespace xraycast
